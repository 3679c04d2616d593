// The researcher's page: progress of the participants, live view, pause, links, export, agreement of ratings.

import {Connection} from "./connection.js";
import {SceneDrawing, fitted, stateBetween} from "./drawing.js";
import {byId, filled, make, socketAddress} from "./elements.js";

const OVERVIEW_PERIOD = 1000, LOOK_PERIOD = 100;   // ms
const COLUMNS = {participant: "researcher.participant", step: "researcher.step", progress: "researcher.progress", runs: "researcher.runs",
  connection: "researcher.connection", lastEvent: "researcher.last_event", condition: "researcher.condition", link: "researcher.link"};
const KINDS = {page: "researcher.page", consent: "researcher.consent", questions: "researcher.questions", practice: "researcher.practice",
  run: "researcher.run", ratings: "researcher.ratings", thanks: "researcher.thanks", screened: "researcher.screened", full: "researcher.full", declined: "researcher.declined"};
const STATES = {driving: "readings.recording", paused: "readings.paused", ended: "readings.frozen"};
const data = JSON.parse(byId("data").textContent), base = data.url || location.origin;
const t = (key, values = {}) => filled(data.words[key] || key, values);
const rows = new Map();
const problems = {files: "", request: ""};    // `request` stays until the next click
let isPaused = false, watched = null, scene = "", drawing = null, before = null, latest = null, arrived = 0, isLooking = false;

const server = new Connection(socketAddress(), {
  receive: answer => {
    if (answer.type === "overview") { showOverview(answer); problems.files = answer.problem; }
    else if (answer.type === "look") showLook(answer);
    else if (answer.type === "agreement") showAgreement(answer.blocks);
    else if (answer.type === "problem") { problems.request = answer.problem; isLooking = false; }
    showProblems();
  },
  status: status => {
    isLooking = false;
    byId("connection").hidden = status === "open";
    byId("connection").textContent = status === "open" ? "" : t("researcher.lost");
    if (status === "open") { server.send({type: "overview"}); server.send({type: "agreement"}); }
  },
});

function showProblems() {
  const words = Object.values(problems).filter(Boolean).join(" ");
  byId("problem").textContent = words; byId("problem").hidden = !words;
}

/** Sends an action of the researcher. */
function order(message) { problems.request = ""; server.send(message); }

// ---- participants

function showOverview({participants, isStudyPaused, open, conditions, quota}) {
  isPaused = isStudyPaused;
  byId("pause").textContent = t(isPaused ? "researcher.resume" : "researcher.pause");
  byId("pause").setAttribute("aria-pressed", isPaused);
  const here = participants.filter(participant => participant.isOpen).length, all = participants.length;
  const finished = participants.filter(participant => participant.kind === "thanks").length;
  byId("summary").textContent = isPaused ? t("researcher.paused") : t("researcher.summary", {here, all, finished});
  byId("open").value = `${base}/j/${open}`;
  byId("completions").hidden = conditions.length < 2;
  byId("completions").textContent = `${t("researcher.completions")}: ` + conditions.map(name =>
    `${name} (${participants.filter(participant => participant.condition === name && participant.kind === "thanks").length})`).join(", ");
  byId("quota").hidden = !quota;
  if (quota) byId("quota").textContent = `${t("researcher.quota", {question: quota.question})}: ` + quota.answers.map(([name, taken, places]) =>
    `${name} (${taken}/${places})`).join(", ");
  participants.forEach(showRow);
  filterRows();
}

/** Shows the rows that contain each word of the filter. */
function filterRows() {
  const words = byId("filter").value.toLowerCase().split(/\s+/);
  for (const {row} of rows.values()) row.hidden = !words.every(word => row.textContent.toLowerCase().includes(word));
}

/** A time of day as ISO 8601 with the time since then, such as "2026-01-31 14:05:09 (3 min ago)". */
function dated(time) {
  const seconds = Math.max((Date.now() - new Date(time)) / 1000, 0);
  const [value, unit] = seconds < 60 ? [seconds, "second"] : seconds < 3600 ? [seconds / 60, "minute"] : seconds < 86400 ? [seconds / 3600, "hour"] : [seconds / 86400, "day"];
  const ago = new Intl.RelativeTimeFormat(document.documentElement.lang, {style: "short"}).format(-Math.floor(value), unit);
  return `${new Date(time).toLocaleString("sv")} (${ago})`;
}

function showRow(participant) {
  if (!rows.has(participant.id)) addRow(participant);
  const {cells, row} = rows.get(participant.id), [done, total] = participant.progress;
  const now = participant.lastEvent || participant.isOpen ? [t(KINDS[participant.kind]), ["thanks", "screened", "full", "declined"].includes(participant.kind) ? "" : `(${participant.step})`]
    : [t("researcher.not_begun")];
  if (participant.isOpen && STATES[participant.status]) now.push(`· ${t(STATES[participant.status])}`);
  const open = t(participant.isOpen ? "researcher.online" : "researcher.offline");
  const texts = {
    step: now.join(" "),
    progress: `${done} / ${total}`,
    runs: participant.runs.join(" / "),
    connection: participant.isOpen && participant.roundTrip !== null ? `${open} · ${Math.round(participant.roundTrip * 1000)} ms` : open,
    lastEvent: participant.lastEvent ? dated(participant.lastEvent) : "",
    condition: participant.condition,
  };
  for (const [name, text] of Object.entries(texts)) if (cells[name].textContent !== text) cells[name].textContent = text;
  row.classList.toggle("online", participant.isOpen);
}

function addRow(participant) {
  const cells = Object.fromEntries(Object.keys(COLUMNS).map(name => [name, make("td")]));
  const choose = make("button", {"aria-pressed": "false", onclick: () => watch(participant.id)}, participant.id);
  cells.participant.append(choose);
  if (participant.token) {
    const field = make("input", {readonly: true, value: `${base}/s/${participant.token}`, "aria-label": `${t("researcher.link")} ${participant.id}`, onfocus: () => field.select()});
    cells.link.append(make("span", {class: "link"}, field, copyButton(field)));
  }
  const row = make("tr", {}, ...Object.values(cells));
  rows.set(participant.id, {cells, row, choose});
  byId("rows").append(row);
}

/** A button that copies a link; null where the browser forbids it: without HTTPS, except on this machine. */
function copyButton(field) {
  if (!navigator.clipboard) return null;
  const button = make("button", {onclick: async () => {
    await navigator.clipboard.writeText(field.value);
    button.textContent = t("researcher.copied");
    setTimeout(() => { button.textContent = t("researcher.copy"); }, 2000);
  }}, t("researcher.copy"));
  return button;
}

// ---- live view

function watch(id) {
  watched = watched === id ? null : id;
  for (const [other, {choose}] of rows) choose.setAttribute("aria-pressed", other === watched);
  latest = null; scene = "";
  byId("live-text").textContent = watched ? "" : t("researcher.nobody");
  look();
}

function look() {
  if (watched !== null && !isLooking) isLooking = server.send({type: "look", participant: watched, scene});
}

function showLook({participant, drive}) {
  isLooking = false;
  if (participant !== watched) { look(); return; }
  byId("live-text").textContent = drive ? `${watched} · ${t("readings.seconds", {time: drive.state.time.toFixed(1)})}` : t("researcher.not_driving", {id: watched});
  byId("screen").hidden = !drive;
  if (!drive) { latest = null; scene = ""; return; }
  if (drive.data) { scene = drive.scene; drawing = new SceneDrawing(drive.data); before = null; } else before = latest;
  latest = drive.state; arrived = performance.now();
}

function draw(now) {
  requestAnimationFrame(draw);
  if (!latest) return;
  const canvas = byId("canvas"), {width, height} = fitted(canvas);
  if (!width || !height) return;
  const state = stateBetween(drawing.scene, before || latest, latest, Math.min((now - arrived) / LOOK_PERIOD, 1));
  drawing.draw(canvas.getContext("2d"), drawing.cameraOf("top", state, width, height), state, {outside: "#e2e5e9"});
}

// ---- ratings

function showAgreement(blocks) {
  byId("agreement").hidden = !blocks.length;
  byId("blocks").replaceChildren(...blocks.map(block => {
    const lines = block.ratings ? [t("researcher.raters", block)] : [t("researcher.no_ratings")];
    if (block.alpha !== null) lines.push(t("researcher.alpha", {measure: block.measure, value: block.alpha.toFixed(2)}));
    else if (block.measure) lines.push(t("researcher.undefined", block));
    if (block.same !== null) lines.push(t("researcher.same", {percent: Math.round(100 * block.same), count: block.repeats}));
    const disputed = block.disputed.map(({file, labels}) => make("li", {}, `${file}: ${Object.entries(labels).map(([rater, label]) => `${rater} ${label}`).join(", ")}`));
    return make("div", {}, make("h3", {}, `${block.name}: ${block.question}`), ...lines.map(line => make("p", {}, line)),
      ...(disputed.length ? [make("h4", {}, t("researcher.disputed")), make("ul", {}, ...disputed)] : []));
  }));
}

// ---- the page

byId("columns").append(...Object.values(COLUMNS).map(key => make("th", {scope: "col"}, t(key))));
byId("export").href = location.pathname.replace(/\/$/, "") + "/export.zip";
byId("export-personal").href = byId("export").href + "?personal=1";
byId("filter").addEventListener("input", filterRows);
const copyOpen = copyButton(byId("open"));
if (copyOpen) byId("open").after(copyOpen);
byId("pause").addEventListener("click", () => order({type: "pause_study", value: !isPaused}));
byId("new").addEventListener("submit", event => {
  event.preventDefault();
  order({type: "add", count: Number(byId("number").value)});
});
setInterval(() => server.send({type: "overview"}), OVERVIEW_PERIOD);
setInterval(() => server.send({type: "agreement"}), 30 * OVERVIEW_PERIOD);
setInterval(look, LOOK_PERIOD);
requestAnimationFrame(draw);
