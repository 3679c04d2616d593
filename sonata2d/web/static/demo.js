// A page without a server: choose a scene, and drive in it or watch a controller.

import {Drive} from "./drive.js";
import {byId, make} from "./elements.js";
import {Simulator} from "./simulator.js";

const KEYS = "teleoperation", OWN = "own";
const SILENT = 8000;        // ms without an answer, after which the code of a controller seems to hang
const CODE = `import math
import sonata2d as s2

class Mine(s2.Controller):
    def act(self, snapshot):
        x, y = snapshot.robot.pose.to_local(snapshot.goal)
        turn = math.atan2(y, x)            # towards the goal
        ahead = 0.8 * max(math.cos(turn), 0)
        if s2.clearance(snapshot) < 0.6:   # m to the nearest person
            ahead = 0.2
        return s2.Twist(ahead, 0, 2 * turn)
`;
const STATUS = {none: "Starting", waiting: "Ready", driving: "Running", pausing: "Paused", paused: "Paused", ended: "Ended", lost: "Stopped"};
const ENDS = {goal: "The robot reached its goal.", timeout: "Time is up.", contact: "The robot touched something, which ends a run of this scenario.",
              stopped: "The run was stopped."};
const data = JSON.parse(byId("data").textContent);
let view = null, isWaiting = true, isAuto = false, silence = null, isReady = false, isSilent = false;

const isDriven = () => byId("controller").value === KEYS;
const fixed = value => value.toFixed(1);

const simulator = new Simulator("./", answer => {
  clearTimeout(silence);
  if (isSilent) { isSilent = false; report(""); }
  if (answer.type === "loading") hint(answer.part === "python" ? "Python is loaded, about 20 MB at the first visit …" : "The simulator is starting …");
  else if (answer.type === "failed") { hint(""); report(`The simulator cannot be started: ${answer.text}`); }
  else if (answer.type === "ready") { isReady = true; open(); }
  else if (answer.type === "error") failed(answer);
  else if (answer.type === "tick") { drive.answered(answer); showReadings(); }
  else if (answer.type === "file") save(answer);
  else if (answer.type === "view") {
    isWaiting = false; view = answer.drive;
    drive.show(view);
    byId("legend").replaceChildren(...view.legend.map(entry => make("li", {}, make("span", {html: entry.symbol, "aria-hidden": "true"}), entry.text)));
    if (isAuto && view.status === "waiting") drive.start();
    isAuto = false;
    show();
  }
});

/** Sends a message, and offers a way out if no answer comes. */
function send(message) {
  if (message.type !== "tick") isWaiting = true;
  clearTimeout(silence);
  if (!isReady) return false;      // what is asked for is opened when Python is loaded
  silence = setTimeout(() => {
    isSilent = true;
    report("The simulator does not answer; the code of the controller may hang. ");
    byId("problem").append(make("button", {onclick: restart}, "Start the simulator again"));
  }, SILENT);
  return simulator.send(message);
}
function restart() {
  clearTimeout(silence);
  isWaiting = true; isAuto = isReady = isSilent = false;
  drive.hide(); report(""); show();
  simulator.restart();
}

const drive = new Drive(byId("canvas"), {send, changed: () => show(), act: perform, isBlocked: () => isWaiting, goalText: distance => `goal: ${fixed(distance)} m`});
drive.input.isActive = event => {
  if (isWaiting || !isDriven()) return false;
  const focus = event && event.target;
  return !focus || !focus.closest || !focus.closest("input, textarea, select, a, button");
};

// ---- settings

for (const name of Object.keys(data.scenarios)) byId("scenario").append(make("option", {value: name}, name));
for (const [name, words] of [[KEYS, "you (keys, touch, game pad)"], ...Object.keys(data.controllers).map(name => [name, name]), [OWN, "your own code"]])
  byId("controller").append(make("option", {value: name}, words));
byId("code").value = CODE;
const asked = new URLSearchParams(location.search);
for (const name of ["scenario", "seed", "controller", "wandering", "standing"]) if (asked.has(name)) byId(name).value = asked.get(name);
if (!asked.has("scenario") || !byId("scenario").value) byId("scenario").value = "lively";
if (!byId("controller").value) byId("controller").value = KEYS;

function describe() {
  byId("about-scenario").textContent = data.scenarios[byId("scenario").value];
  byId("about-controller").textContent = data.controllers[byId("controller").value] || "";
  byId("own").hidden = byId("controller").value !== OWN;
  for (const name of ["wandering", "standing"]) byId(`${name}-value`).textContent = byId(name).value < 0 ? "as described" : byId(name).value;
}

/** Opens the scene of the settings; the address of the page then leads to it. */
function open() {
  describe();
  if (!byId("settings").reportValidity()) return;
  const changes = {}, controller = byId("controller").value, shared = new URLSearchParams({scenario: byId("scenario").value, seed: byId("seed").value, controller});
  for (const name of ["wandering", "standing"]) if (byId(name).value >= 0) { changes[name] = Number(byId(name).value); shared.set(name, byId(name).value); }
  history.replaceState(null, "", `?${shared}`);
  report("");
  send({type: "open", scenario: byId("scenario").value, seed: Number(byId("seed").value), changes, controller, code: controller === OWN ? byId("code").value : null});
  show();
}
byId("settings").addEventListener("change", event => {
  if (event.target.id === "code") return;
  if (event.target.id === "controller" && event.target.value === OWN) { describe(); return; }
  open();
});
byId("settings").addEventListener("input", describe);
byId("settings").addEventListener("submit", event => {
  event.preventDefault();
  const hangs = isSilent;
  if (hangs) restart();      // the code before this one never ends
  isAuto = true;
  if (!hangs) open();
});
byId("another").addEventListener("click", () => { byId("seed").value = (Number(byId("seed").value) || 0) + 1; open(); });

// ---- driving

byId("go").addEventListener("click", () => { perform("confirm"); focusPicture(); });
byId("again").addEventListener("click", () => { open(); focusPicture(); });
byId("view").addEventListener("click", () => { drive.perform("view"); show(); focusPicture(); });
byId("zones").addEventListener("click", () => { drive.perform("zones"); show(); focusPicture(); });
byId("save").addEventListener("click", () => send({type: "file"}));
const focusPicture = () => byId("canvas").focus({preventScroll: true});

/** Carries out an action of a key, a button or a game pad; false if it is not possible now. */
function perform(action) {
  if (isWaiting) return false;
  const {status} = drive;
  if (action === "confirm" || action === "pause") {
    if (status === "driving") drive.pause();
    else if (status === "waiting" || status === "paused") drive.start();
    else if (status === "ended") open();
  } else if (action === "redo") open();
  else if (action === "discard") byId("another").click();
  else return false;
  return true;
}

function failed(answer) {
  isWaiting = false;
  drive.status = "none";
  report(answer.line ? `Line ${answer.line}: ${answer.text}` : answer.text);
  if (answer.line) {      // select the line
    const lines = byId("code").value.split("\n"), start = lines.slice(0, answer.line - 1).join("\n").length + (answer.line > 1 ? 1 : 0);
    byId("code").focus();
    byId("code").setSelectionRange(start, start + (lines[answer.line - 1] || "").length);
  }
  show();
}

function save({name, text}) {
  isWaiting = false;
  const address = URL.createObjectURL(new Blob([text], {type: "application/json"}));
  make("a", {href: address, download: name}).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

function show() {
  const {status} = drive;
  byId("status").textContent = STATUS[status]; byId("status").className = status;
  byId("go").disabled = isWaiting || !["waiting", "paused", "driving"].includes(status);
  byId("go").textContent = status === "driving" ? "Pause" : status === "paused" || status === "pausing" ? "Continue" : "Start";
  byId("again").disabled = isWaiting;
  byId("view").textContent = drive.view === "top" ? "Follow the robot" : "Whole room";
  byId("zones").setAttribute("aria-pressed", String(drive.zones));
  byId("save").hidden = status !== "ended";
  if (view) hint(status === "waiting" ? (isDriven() ? "Drive to the green target with the arrow keys; touch: drag on the picture." : "Press Start, and watch.")
    : status === "ended" ? ENDS[drive.outcome] || "The run has ended." : "");
  showReadings();
}
function hint(words) { byId("hint").textContent = words; }
function report(words) {
  byId("problem").textContent = words; byId("problem").hidden = !words;
  if (words) byId("problem").scrollIntoView({block: "nearest"});
}
function showReadings() {
  if (!view || !drive.now || drive.run === null) return;
  const {time, speed, goal, nearest, touches, hasArrived} = drive.readings();
  byId("hint").classList.toggle("above", drive.isGoalBelow); byId("hint").classList.toggle("later", drive.isOverview);
  byId("time").textContent = `${fixed(time)} of ${Math.round(view.limit)} s`;
  byId("speed").textContent = `${fixed(speed)} m/s`;
  byId("goal").textContent = hasArrived ? "at the goal" : `goal: ${fixed(goal)} m`;
  byId("nearest").textContent = touches ? `touches: ${touches}` : nearest === null ? "nobody there" : `nearest person: ${fixed(Math.max(nearest, 0))} m`;
  byId("nearest").className = touches ? "touching" : nearest !== null && nearest < 1.2 ? "near" : "";
}
document.addEventListener("visibilitychange", () => { if (document.hidden) drive.pause(); });
setInterval(showReadings, 100);
describe();
