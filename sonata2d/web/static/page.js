// The page of a participant: shows the present step, and sends the actions of the participant.

import {Connection} from "./connection.js";
import {isTouched, lacking} from "./device.js";
import {Drive} from "./drive.js";
import {byId, filled, make, socketAddress, translate} from "./elements.js";
import {form, question} from "./questions.js";
import {Simulator} from "./simulator.js";
import {Watch} from "./watch.js";

const PROTOCOL = 2;
const TOUCHED = {human: "readings.touching_human", object: "readings.touching_object", wall: "readings.touching_wall",
                 robot: "readings.touching_robot"};
const PAUSE_OF_CARD = 500;     // ms, in which keys that were pressed to drive do not answer the card
const PROBLEMS = {refused: "web.not_possible", failed: "web.server_failed", wrong: "web.check_again"};
const PINGS = 7;      // of which the median is the round-trip time that a study may limit
const data = JSON.parse(byId("data").textContent);
let language = data.languages[0], view = null, stepOnShow = null, isWaiting = false, connection = "lost", label = null;
let problem = "";      // of the last message
const pings = [];      // round-trip times, s
let pinged = 0;        // time at which the last ping was sent, ms; 0 before the first
let wasMissing = false;      // whether the page shows what the device lacks
let notice = "";       // about a device; shown until the run goes on

/** A text of the page in the participant's language. */
function t(key, values = {}) {
  return filled((data.words[language] || {})[key] || key, values);
}
/** A text with a capital letter, for buttons; the tables have it in small letters, as within a line. */
function capital(key) {
  const words = t(key);
  return words.charAt(0).toUpperCase() + words.slice(1);
}
const seconds = time => time.toFixed(1);

const server = new Connection(socketAddress(), {
  receive: answer => {
    if (answer.type === "tick") { drive.answered(answer); showReadings(); return; }
    if (answer.type === "pong") { pings.push((performance.now() - pinged) / 1000); ping(); return; }
    isWaiting = false;
    if (answer.type === "error") { report(t(PROBLEMS[answer.problemKind])); setBusy(); return; }
    show(answer);
  },
  status: status => {
    connection = status;
    if (status === "open") { isWaiting = false; pinged = 0; pings.length = 0; send(hello()); }
    else { drive.status = drive.run === null ? "none" : "lost"; drive.input.release(); }
    showConnection();
    if (view) showDriving();
  },
});

const hello = () => ({type: "hello", protocol: PROTOCOL, languages: navigator.languages.slice(0, 9), touch: isTouched,
                      screen: [screen.width, screen.height].map(Math.round), window: [innerWidth, innerHeight].map(Math.round)});

/** Measures the round-trip time, if the study limits it, and then asks for the page. */
function ping() {
  if (pings.length >= PINGS) { send(hello()); return; }
  pinged = performance.now();
  server.send({type: "ping"});
}
/** Sends a message; buttons are disabled until the answer. */
function send(message) {
  const isSent = server.send(message);
  if (isSent && message.type !== "tick") { isWaiting = true; setBusy(); }
  return isSent;
}
function setBusy() {
  document.body.classList.toggle("busy", isWaiting);
  for (const button of document.querySelectorAll("button[data-sends]")) button.disabled = isWaiting || connection !== "open";
}

// With a simulator of its own, the page shows each tick before the server's answer arrives; without one, after it.
let simulator = null;
function startSimulator() {
  if (!data.simulator || simulator) return;
  simulator = new Simulator(data.simulator, answer => {
    if (answer.type === "tick") drive.foreseen(answer);
    else if (answer.type === "ready") { drive.simulate = message => simulator.send(message); drive.follow(); }
    else if (answer.type === "error" || answer.type === "failed") { drive.differ(); console.warn(answer.text); }      // the server's answers remain
  });
}
const drive = new Drive(byId("canvas"), {send, changed: () => showDriving(), act: (action, device) => perform(action, device), isBlocked: () => isWaiting,
                                         goalText: distance => t("readings.goal", {distance: seconds(distance)})});
const watch = new Watch(byId("film"), () => showWatching());
drive.input.isActive = event => {
  if (!view || !view.drive || isWaiting || byId("help").open) return false;
  const focus = event && event.target;
  if (!focus || !focus.closest) return true;
  if (focus.matches("input[type=radio]")) return !/^(Arrow.*| )$/.test(event.key);      // these keys choose another answer
  return !focus.closest("input, textarea, select, a, button, dialog");
};

// ---- the view

function show(next) {
  const former = view;
  view = next; language = view.language;
  document.documentElement.lang = language;
  showFrame();
  if (showMissing()) return;
  const isDriving = Boolean(view.drive), isRating = Boolean(view.rating);
  byId("driving").hidden = !isDriving; byId("watching").hidden = !isRating;
  byId("step").hidden = isDriving || isRating;
  document.body.classList.toggle("wide", isDriving || isRating);
  if (isDriving) {
    if (drive.run !== view.drive.run || !former || !former.drive) label = view.drive.undoneLabel;
    drive.show(view.drive);
    showDriving(true);
    if (byId("help").open) showLegend();
  } else drive.hide();
  if (isRating) { watch.show(view.rating); showRating(former); } else watch.hide();
  if (!isDriving && !isRating) showStep();
  const key = `${view.step.id}/${view.step.kind}/${language}`;
  if (stepOnShow !== null && stepOnShow !== key) {      // a screen reader reads it, and the Tab key continues from here
    scrollTo(0, 0);
    (isDriving ? byId("canvas") : isRating ? byId("film") : byId("title")).focus({preventScroll: true});
  }
  stepOnShow = key;
  const reason = view.problemKind === "refused" && view.step.kind === "questions" ? ` (${view.problem})` : "";
  report(view.problemKind ? t(PROBLEMS[view.problemKind]) + reason : "");
  setBusy();
}

/** The requirement that the device does not meet, in words; empty if it meets all. */
function missing() {
  const limit = data.requires.round_trip, middle = [...pings].sort((a, b) => a - b)[PINGS >> 1];
  const words = lacking(data.requires, t);
  if (words) return words;
  if (!limit || view.progress[0] > 0) return "";      // whoever has begun goes on
  if (pings.length < PINGS) return t("web.measuring");
  return middle > limit ? t("web.needs_connection", {seconds: middle.toFixed(2), limit}) : "";
}
/** Shows what the device lacks in place of the step; false if it lacks nothing. */
function showMissing() {
  const words = missing();
  wasMissing = Boolean(words);
  if (data.requires.round_trip && view.progress[0] === 0 && !pinged) ping();
  else startSimulator();      // its download would slow the measurement down
  if (!words) return false;
  for (const id of ["driving", "watching"]) byId(id).hidden = true;
  byId("step").hidden = false; document.body.classList.remove("wide");
  byId("step").replaceChildren(make("h1", {id: "title", tabindex: -1}, text(data.title)), make("p", {id: "missing"}, words));
  if (drive.status === "driving") drive.pause();
  stepOnShow = null;
  return true;
}
addEventListener("resize", () => {
  if (!view) return;
  if (wasMissing !== Boolean(missing())) send(hello());      // for the present state: the view on show may be from before a run
  else showDriving();
});

function showFrame() {
  const [done, total] = view.progress, [kept, runs] = view.runs;
  document.title = text(data.title);
  byId("study").textContent = text(data.title);
  byId("progress").max = total; byId("progress").value = done;
  translate(t);
  const place = ["thanks", "screened"].includes(view.step.kind) ? "" : t("web.progress", {number: Math.min(done + 1, total), total});
  byId("progress").setAttribute("aria-label", place || t("rating.thanks"));
  byId("count").textContent = !view.drive ? place : view.drive.isPractice ? t("web.practice")
    : t("readings.run_of", {number: Math.min(kept + 1, runs), count: runs});
  byId("number").textContent = t("web.number", {id: view.participant}); byId("number").hidden = Boolean(view.drive || view.rating);
  byId("preview").hidden = !view.isPreview || view.step.kind === "thanks";
  byId("driving-title").textContent = byId("count").textContent;
  const select = byId("language");
  select.hidden = data.languages.length < 2;
  if (!select.options.length) for (const name of data.languages) select.append(make("option", {value: name}, data.words[name]["web.name"]));
  select.value = language;
}
const text = words => typeof words === "string" ? words : words[language] || Object.values(words)[0];

/** A page, the consent, questions, or the end. */
function showStep() {
  const step = view.step, place = byId("step"), key = `${step.id}/${step.kind}/${language}`;
  if (stepOnShow === key && place.childElementCount) return;      // keeps the answers that are filled in
  const title = make("h1", {id: "title", tabindex: -1}, step.title || titleOf(step));
  const parts = [title];
  if (step.html) parts.push(make("div", {class: "prose", html: step.html}));
  const next = (words, act, attributes = {}) => make("button", {class: "primary", "data-sends": true, onclick: act, ...attributes}, words);
  if (step.kind === "page") parts.push(next(t("web.continue"), () => send({type: "read", step: step.id})));
  if (step.kind === "consent") parts.push(consent(step, next));
  if (step.kind === "questions") {
    const former = stepOnShow !== null && stepOnShow.startsWith(`${step.id}/`) ? place.querySelector("form") : null;
    const answers = former ? former.answers() : {};      // filled in before the language was changed
    const element = form(step.questions, t, values => send({type: "answer", step: step.id, values}), t("web.continue"), answers);
    element.querySelector("button[type=submit]").dataset.sends = "";
    parts.push(element);
  }
  if (step.kind === "declined") {
    parts.push(make("p", {}, t("web.declined")), next(t("web.reconsider"), () => send({type: "reconsider"})));
  }
  if (step.kind === "screened") parts.push(make("p", {}, t(step.isFull ? "web.full_study" : "web.screened")));
  if (step.leave) parts.push(leaving(step.leave));
  if (step.kind === "thanks" && !step.html) parts.push(make("p", {}, t("web.thanks")));
  if (view.canUndo) parts.push(make("p", {class: "aside"}, make("button", {"data-sends": true, onclick: () => send({type: "undo"})}, t("menu.undo"))));
  if (step.kind === "page" && view.progress[0] === 0) parts.push(make("p", {class: "hint"}, t("web.address")));
  place.replaceChildren(...parts);
}
/** The way back to the panel: a link, or a code. */
function leaving({address, code}) {
  return address ? make("p", {}, make("a", {class: "primary", href: address}, t("web.leave"))) : make("p", {}, `${t("web.code")} `, make("strong", {id: "code"}, code));
}
function titleOf(step) {
  return {questions: t("web.questions"), thanks: t("rating.thanks"), screened: t(step.isFull ? "web.full_title" : "web.screened_title"), declined: t("web.declined_title"), page: text(data.title)}[step.kind] || text(data.title);
}
function consent(step, next) {
  const boxes = step.statements.map((html, k) => make("input", {type: "checkbox", id: `tick-${k}`}));
  const lines = boxes.map((box, k) => make("div", {class: "tick"}, box, make("label", {for: box.id, html: step.statements[k]})));
  const problem = make("p", {class: "problem", role: "alert", hidden: true}, t("web.tick_all"));
  const agree = () => {
    problem.hidden = boxes.every(box => box.checked);
    if (problem.hidden) send({type: "consent", step: step.id, ticked: boxes.map(box => box.checked)});
    else boxes.find(box => !box.checked).focus();
  };
  return make("div", {}, ...lines, problem, make("div", {class: "buttons"}, next(t("web.agree"), agree),
    make("button", {"data-sends": true, onclick: () => send({type: "decline", step: step.id})}, t("web.decline")),
    make("button", {id: "save-text", onclick: () => saveText(step)}, t("web.save_text"))));
}
/** Saves the text of the consent as a file. */
function saveText(step) {
  const title = step.title || text(data.title), copy = document.implementation.createHTMLDocument(title);
  copy.documentElement.lang = language;
  copy.head.prepend(make("meta", {charset: "utf-8"}));
  copy.body.append(make("h1", {}, title), make("div", {html: step.html}), make("ul", {}, ...step.statements.map(html => make("li", {html}))),
    make("p", {}, `${text(data.title)}. ${t("web.number", {id: view.participant})}. ${new Date().toISOString().slice(0, 10)}`));
  for (const picture of copy.querySelectorAll("img")) picture.setAttribute("src", new URL(picture.getAttribute("src"), location.href).href);
  const address = URL.createObjectURL(new Blob(["<!DOCTYPE html>\n", copy.documentElement.outerHTML], {type: "text/html"}));
  make("a", {href: address, download: `${view.participant}-${step.id}.html`}).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

// ---- driving

const CHANGES = [["view", "view", "keys.camera"], ["zones", "zones", "keys.zones"], ["zoom", "zoomIn", "action.zoom_in"], ["zoom", "zoomOut", "action.zoom_out"]];
const isNarrow = () => Math.min(innerWidth, innerHeight) <= 560;
let isUnfolded = false;
const SIGNS = {waiting: "○", driving: "●", paused: "❚❚", pausing: "❚❚", ended: "■", lost: "!"};
const WORDS = {waiting: "readings.waiting", driving: "readings.recording", paused: "readings.paused", pausing: "readings.paused", ended: "readings.frozen", lost: "readings.paused"};

function showDriving(isNew = false) {
  if (!view || !view.drive) return;
  const {status} = drive, {drive: run} = view;
  byId("status").textContent = `${SIGNS[status] || ""} ${t(WORDS[status] || "readings.waiting")}`;
  byId("status").className = status;
  byId("hint").textContent = drive.isStudyPaused ? t("web.study_paused") : status === "waiting" ? t(!run.isPractice ? "web.drive_hint" : isTouched ? "web.practice_touch" : "web.practice_hint") + rulesOf(run)
    : drive.isSlow ? t("web.slow") : status === "paused" || status === "pausing" ? t("web.paused") : "";
  if (status === "driving") notice = "";
  report(problem);
  byId("context").textContent = run.context || "";
  const buttons = [];
  const add = (key, act, attributes = {}) => buttons.push(make("button", {onclick: act, "data-key": key, ...attributes}, capital(key)));
  if (status === "driving") { add("action.pause", () => drive.pause()); add("keys.end_run", () => drive.stop()); }
  if (status === "paused" && !drive.isStudyPaused) { add("menu.continue", () => drive.start(), {class: "primary"}); add("keys.end_run", () => drive.stop(), {"data-sends": true}); }
  if (status === "waiting" && view.canUndo) add("menu.undo", () => send({type: "undo"}), {"data-sends": true});
  // On a phone, the buttons of the picture would leave little room for it: one button shows them.
  const changes = status === "ended" ? [] : CHANGES.filter(([change]) => run.changes.includes(change)), isFolded = isNarrow() && changes.length > 1;
  if (isFolded) add("web.view", () => { isUnfolded = !isUnfolded; showDriving(); }, {"aria-expanded": String(isUnfolded)});
  if (!isFolded || isUnfolded) for (const [, action, key] of changes) add(key, () => { drive.perform(action); focusPicture(); });
  add("keys.help", () => showHelp());
  const focused = document.activeElement.closest("#actions button");
  byId("actions").replaceChildren(...buttons);
  if (focused && status !== "ended") (buttons.find(button => button.dataset.key === focused.dataset.key) || byId("canvas")).focus({preventScroll: true});
  showCard(status, run);
  showFrameLabel(run, isNew);
  showReadings();
  setBusy();
}

/** What a run has to be to count, in words. */
function rulesOf({rules, isPractice}) {
  const {minimum_length: least, minimum_distance: metres, must_reach_goal: mustReach} = rules;
  return [mustReach && !isPractice && t("web.drive_rule"), metres && t("web.rule_distance", {metres}), least && t("web.rule_time", {seconds: least})]
    .filter(Boolean).map(words => ` ${words}`).join("");
}
/** Lets keys drive again, after a button was clicked. */
const focusPicture = () => byId("canvas").focus({preventScroll: true});

const hasPad = () => Boolean(navigator.getGamepads) && navigator.getGamepads().some(Boolean);

// Rows of the help: keys or buttons, their action, and in which runs it is possible.
const KEYS = [
  ["help.ahead_keys", "help.ahead"], ["help.turn_keys", "help.turn"], ["Q E", "help.sideways", run => run.isHolonomic], ["player.space_key", "help.brake"],
  ["help.mouse_keys", "help.mouse"], ["help.left_stick_keys", "help.left_stick", hasPad],
  ["help.right_stick_keys", "help.sideways", run => run.isHolonomic && hasPad()], ["help.shoulder_keys", "help.brake", hasPad], ["help.confirm_keys", "help.confirm"], ["help.pause_keys", "action.pause"],
  ["help.discard_keys", "action.discard", run => run.allowed.discard], ["help.redo_keys", "action.redo", run => run.allowed.redo],
  ["help.undo_keys", "action.undo", run => run.allowed.undo], ["help.label_keys", "help.labels", run => run.label],
  ["help.label_step_keys", "help.label_step", run => run.label], ["help.view_keys", "action.view", run => run.changes.includes("view")],
  ["Z", "action.zones", run => run.changes.includes("zones")], ["+ -", "help.zoom", run => run.changes.includes("zoom")],
  ["help.hud_keys", "action.hud"], ["F1", "help.this"],
];

/** The help: keys, and the meaning of symbols; the run is paused meanwhile. */
function showHelp() {
  if (byId("help").open) { byId("help").close(); return; }
  drive.pause();
  const rows = isTouched ? [["web.touch", "help.mouse"]] : KEYS.filter(([, , isAllowed]) => !isAllowed || isAllowed(view.drive));
  byId("keys").replaceChildren(...rows.flatMap(([keys, meaning]) => [make("dt", {}, t(keys)), make("dd", {}, t(meaning))]));
  showLegend();
  byId("help").showModal();
}
function showLegend() {
  byId("legend").replaceChildren(...view.drive.legend.map(entry => make("li", {}, make("span", {html: entry.symbol, "aria-hidden": "true"}), entry.text)));
}

/** Whether the card appeared just now, so that a key may have been pressed to drive. */
const isCardNew = () => performance.now() - byId("card").shownAt < PAUSE_OF_CARD;

/** The card of a run that ended: the question about it, and buttons to keep, discard or repeat it. */
function showCard(status, run) {
  const card = byId("card");
  if (status !== "ended") { card.hidden = true; card.replaceChildren(); return; }
  const key = `${run.run}/${language}`;
  if (!card.hidden && card.dataset.key === key) return;
  if (card.hidden) card.shownAt = performance.now();
  card.dataset.key = key; card.hidden = false;
  const {broken} = drive, time = drive.states.get(drive.latest).time, {minimum_length: least, minimum_distance: metres} = run.rules;
  const reason = {minimum_length: ["web.too_short", {seconds: least}], minimum_distance: ["web.too_near", {metres}],
                  must_reach_goal: [run.isPractice ? "web.practice_again" : "web.must_reach"]}[broken];
  const above = make("p", {class: "above"}, t(`run.${drive.outcome || "stopped"}`, {time: seconds(time)}));
  const buttons = [], explained = [], id = run.run;
  const add = (words, message, attributes = {}) => buttons.push(make("button", {"data-sends": true, onclick: () => send(message), ...attributes}, words));
  let asked = null, heading;
  if (run.isPractice) {
    heading = broken ? "" : t("web.practice_done");
    if (!broken) add(t("web.continue"), {type: "finish_practice", run: id}, {class: "primary", id: "confirm"});
    add(capital("keys.redo"), {type: "redo", run: id}, broken ? {class: "primary", id: "confirm"} : {});
  } else {
    if (run.label && run.label.when === "run") {
      asked = question({...run.label, answer: label}, t);
      asked.addEventListener("answered", () => { label = asked.answer; asked.setProblem(""); });
    }
    heading = asked || broken ? "" : t("run.keep_question");
    const keep = make("button", {class: "primary", id: "confirm", "data-sends": true, onclick: () => keepRun(asked)}, capital("keys.keep"));
    const redo = attributes => add(capital("keys.redo"), {type: "redo", run: id}, attributes);
    if (broken) redo({class: "primary", id: "confirm"}); else buttons.push(keep);
    if (run.allowed.discard) add(capital("keys.discard"), {type: "discard", run: id});
    if (run.allowed.redo && !broken) redo({});
    if (run.allowed.discard) explained.push(make("p", {class: "hint"}, t("web.about_discard")));
    if (run.allowed.redo || broken) explained.push(make("p", {class: "hint"}, t("web.about_redo")));
  }
  card.replaceChildren(above, ...(heading ? [make("h2", {}, heading)] : []), ...(asked && !broken ? [asked] : []),
    ...(reason ? [make("p", {class: "problem"}, t(...reason))] : []),
    make("div", {class: "buttons"}, ...buttons), ...explained);
  card.asked = asked;
  const first = card.querySelector("input, button");
  if (first) first.focus({preventScroll: true});
}
function keepRun(asked) {
  if (asked && !asked.isAnswered()) { asked.setProblem(t("notice.answer_first")); return; }
  send({type: "keep", run: view.drive.run, label: asked ? asked.answer : null});
}

/** The question that is asked while driving. */
function showFrameLabel(run, isNew) {
  const place = byId("while"), spec = run.label;
  place.hidden = !spec || spec.when !== "frame" || drive.status === "ended";
  if (place.hidden || (!isNew && place.childElementCount)) return;
  const asked = question({...spec, answer: drive.waitingLabel ? drive.waitingLabel.answer : drive.frameLabel}, t);
  asked.addEventListener("answered", () => {
    drive.label(asked.position(), asked.answer);
    if (place.contains(document.activeElement)) focusPicture();
  });
  place.replaceChildren(asked);
  place.asked = asked;
}

function showReadings() {
  if (!view || !view.drive || !drive.now) return;
  const {time, speed, goal, nearest, touches, hasArrived} = drive.readings();
  byId("hint").classList.toggle("above", drive.isGoalBelow); byId("hint").classList.toggle("later", drive.isOverview);
  byId("time").textContent = t("web.time_of", {time: seconds(time), limit: Math.round(view.drive.limit)});
  byId("speed").textContent = t("readings.speed", {speed: seconds(speed)});
  byId("goal").textContent = hasArrived ? t("readings.arrived") : t("readings.goal", {distance: seconds(goal)});
  byId("nearest").textContent = touches ? t(TOUCHED[touches]) : nearest === null ? t("readings.nobody")
    : t("readings.nearest", {distance: seconds(Math.max(nearest, 0))});
  byId("nearest").className = touches ? "touching" : nearest !== null && nearest < 1.2 ? "near" : "";
}

/** Carries out an action of a key or a game pad; false if it is not possible now. */
function perform(action, device) {
  if (!view || !view.drive || isWaiting) return false;
  const {status} = drive, {drive: run} = view, card = byId("card");
  if (action === "confirm") {      // one key leads through a run: start, end, keep
    if (status === "driving") drive.stop();
    else if (status === "waiting" || status === "paused") drive.start();
    else if (status === "ended" && byId("confirm") && !isCardNew()) byId("confirm").click();
  } else if (action === "pause") {
    if (status === "driving") drive.pause(); else if (status === "paused") drive.start(); else return false;
  } else if (action === "discard" || action === "redo") {      // the first press ends the run, and the card asks again
    if (status === "driving" || status === "paused") drive.stop();
    else if (status === "ended" && (run.allowed[action] || run.isPractice)) send({type: run.isPractice ? "redo" : action, run: run.run});
  } else if (action === "padLost") {
    drive.pause();
    notice = t("notice.pad_lost", {device});
    report("");
  } else if (action === "readings") {
    byId("readings").hidden = !byId("readings").hidden;
  } else if (action === "help") {
    showHelp();
  } else if (action === "undo") {
    if (view.canUndo && status === "waiting") send({type: "undo"});
  } else if (action.startsWith("label")) {
    const asked = status === "ended" ? card.asked : byId("while").asked;
    if (!asked || !run.label) return false;
    asked.move(action);
  } else return false;
  return true;
}

// ---- rating

function showRating(former) {
  const {rating} = view;
  byId("film-context").textContent = rating.context || "";
  byId("rated").textContent = t("rating.progress", {percent: Math.round(100 * rating.done), rater: ""}).replace(/[·\s]+$/, "");
  const isNew = !former || !former.rating || former.rating.shown !== rating.shown || former.language !== language;
  if (isNew) {
    const place = byId("rating"), isSame = former && former.rating && former.rating.shown === rating.shown;
    const asked = question({...rating.label, answer: isSame ? place.asked.answer : null}, t);
    place.asked = asked;
    const save = make("button", {class: "primary", id: "save", "data-sends": true, onclick: () => {
      if (!watch.isWhole) { report(t("rating.watch_to_end")); return; }
      if (!asked.isAnswered()) { asked.setProblem(t("rating.answer_first")); return; }
      send({type: "rate", shown: rating.shown, label: asked.answer, seconds: Math.round(watch.seconds * 100) / 100, whole: watch.isWhole});
    }}, t("rating.save"));
    asked.addEventListener("answered", () => asked.setProblem(""));
    place.replaceChildren(asked, save);
    if (former && former.rating) byId("film").focus({preventScroll: true});
    byId("film-buttons").replaceChildren(
      make("button", {id: "play", onclick: () => watch.play(!watch.isPlaying)}, ""),
      make("button", {onclick: () => watch.again()}, t("rating.again")));
  }
  if (rating.breakDue && byId("break").hidden) {
    byId("break").hidden = false; watch.isPlaying = false;
    const goOn = () => { byId("break").hidden = true; send({type: "rest"}); watch.play(true); byId("film").focus({preventScroll: true}); };
    byId("break").replaceChildren(make("h2", {id: "break-title"}, t("rating.break")), make("p", {}, t("rating.break_line")),
      make("button", {class: "primary", onclick: goOn}, t("web.continue")));
    byId("break").querySelector("button").focus({preventScroll: true});
  }
  showWatching();
}
function showWatching() {
  if (!view || !view.rating || watch.shown === null) return;
  byId("film-time").max = watch.end; byId("film-time").value = watch.moment;
  byId("film-time").setAttribute("aria-label", t("player.time", {time: seconds(watch.moment * watch.data.dt), length: seconds(watch.end * watch.data.dt), speed: 1}));
  if (byId("play")) byId("play").textContent = t(watch.isPlaying ? "player.pause" : "player.play");
  const inputs = byId("rating").querySelectorAll("input, textarea");
  for (const input of inputs) input.disabled = !watch.isWhole;
  byId("wait").textContent = watch.isWhole ? "" : t("rating.wait");
}

// ---- connection, language, help

/** Shows the problem of the last message; without one, a notice about the run or a device. */
function report(words) {
  problem = words;
  const isDriving = view && view.drive;
  const shown = problem || (isDriving && view.drive.isRestarted && drive.status === "waiting" ? t("web.restarted")
    : isDriving && drive.isUnsaved ? t("web.unsaved") : notice);
  if (byId("problem").textContent !== shown) byId("problem").textContent = shown;
  byId("problem").hidden = !shown;
}
function showConnection() {
  const words = {lost: "web.lost", taken: "web.taken", refused: "web.refused", unknown: "web.unknown", mistakes: "web.mistakes"}[connection];
  byId("connection").hidden = !words;
  byId("connection").textContent = words ? t(words) : "";
  if (connection === "taken") byId("connection").append(" ", make("button", {id: "here", onclick: () => location.reload()}, t("web.here")));
  setBusy();
}
// Keys that are still held, or were pressed to drive, must not press a button or choose an answer of the card.
byId("card").addEventListener("keydown", event => {
  const isPress = ["Enter", " "].includes(event.key);
  if (isCardNew() ? isPress || event.key.startsWith("Arrow") : isPress && event.repeat) event.preventDefault();
});
addEventListener("keydown", event => {      // on pages with questions; `Input` does it while driving
  const isUndo = event.ctrlKey && event.key.toLowerCase() === "z" && !event.target.closest("textarea, .question > input");
  if (isUndo && view && !view.drive && view.canUndo && !isWaiting) { event.preventDefault(); send({type: "undo"}); }
});
byId("language").addEventListener("change", event => send({type: "language", language: event.target.value}));
byId("skip").addEventListener("click", () => send({type: "skip", step: view.step.id}));
document.addEventListener("visibilitychange", () => { if (document.hidden) drive.pause(); });
addEventListener("blur", () => drive.pause());
setInterval(showReadings, 100);
// While the researcher has paused the study, the page asks whether it goes on.
setInterval(() => { if (view && view.drive && drive.isStudyPaused && !isWaiting && drive.status !== "ended") send({type: "pause", run: view.drive.run}); }, 1000);
