// Questions: one renderer for each kind, and forms. Native elements, so that keyboards and screen readers know them.

import {make} from "./elements.js";

const LABEL_STEP = .1;      // of a slider, by one key
let count = 0;

/** Radio buttons in a row, from pairs of an answer and its text. */
function choices(name, pairs, chosen, changed) {
  return pairs.map(([answer, text], k) => {
    const input = make("input", {type: "radio", name, id: `${name}-${k}`, value: k, onchange: () => changed(answer)});
    input.checked = answer === chosen;
    input.answer = answer;
    return make("label", {class: "choice", for: input.id}, input, make("span", {}, text));
  });
}

/** A renderer of a choice: `pairs` in the order of the page, `levels` in the order of the scale. */
const choice = (pairs, levels) => ({
  draw: ({spec, id, t, answer, changed}) => [make("div", {class: "choices"}, ...choices(id, pairs(spec, t), answer, changed))],
  position: (answer, spec) => levels(spec).indexOf(answer) / Math.max(levels(spec).length - 1, 1),
  move(element, action) {
    const all = levels(element.spec), now = all.indexOf(element.answer), digit = Number(action.slice("label".length));
    const level = all[digit ? digit - 1 : action === "labelUp" ? Math.min(now + 1, all.length - 1) : Math.max(now - 1, 0)];
    const input = [...element.querySelectorAll("input")].find(radio => radio.answer === level);
    if (input) input.click();
  },
});

/** A renderer of a field of the browser: `attributes` of a question, and the answer that `read` makes of its text. */
const field = (tag, attributes, read = text => text) => ({
  isField: true,
  draw({spec, id, answer, changed}) {
    const element = make(tag, {id, ...attributes(spec)});
    if (answer !== null) element.value = answer;
    // an incomplete date or number has the value "": it is sent as a text that is refused, not taken for no answer
    element.addEventListener("input", () => {
      const text = element.value.trim();
      changed(element.validity.badInput ? "?" : text === "" ? null : read(text));
    });
    return [element];
  },
});

// Renderers by name, as kinds of questions name them; a kind without a renderer gets a text field. Each one has
// - draw({spec, id, t, answer, changed}): returns the elements for the answer, which call `changed` with each new answer;
// and where it differs from DEFAULTS:
// - isField: whether the only element is a field, labelled by the question; else the question is the legend of a group;
// - isAnswered(answer, spec): whether the answer is complete;
// - problem(answer, spec, t): why the answer cannot be sent. The server checks all answers again;
// - position(answer, spec): of an answer on its scale, 0 to 1, for labels that are given while driving;
// - move(element, action): choose another answer by key: `labelUp`, `labelDown`, or `label3` for the third level.
const RENDERERS = {
  yes_no: choice((spec, t) => [[true, t("question.yes")], [false, t("question.no")]], () => [false, true]),
  classes: choice(spec => spec.classes.map((name, k) => [k + 1, name]), spec => spec.classes.map((_, k) => k + 1)),
  slider: {
    draw: slider,
    position: answer => answer,
    move(element, action) {
      const step = {labelUp: LABEL_STEP, labelDown: -LABEL_STEP}[action], input = element.querySelector("input");
      if (!step) return;
      input.value = element.answer === null ? .5 : Math.min(Math.max(element.answer + step, 0), 1);
      input.dispatchEvent(new Event("input"));
    },
  },
  text: field("textarea", () => ({rows: 2, maxlength: 5000})),
  input: field("input", spec => ({type: spec.input})),
  number: {
    ...field("input", spec => ({type: "number", min: spec.minimum, max: spec.maximum, step: spec.integer ? 1 : "any", inputmode: spec.integer ? "numeric" : "decimal"}), Number),
    problem(answer, {minimum: low, maximum: high, integer}, t) {
      const isRight = !Number.isNaN(answer) && (!integer || Number.isInteger(answer)) && answer >= (low ?? -Infinity) && answer <= (high ?? Infinity);
      return isRight ? "" : t(integer ? "web.whole_number" : "web.wrong_number", {low: low ?? "…", high: high ?? "…"});
    },
  },
  likert: {draw: table, isAnswered: (answer, spec) => spec.items.every(item => answer && answer[item.name])},
};
const DEFAULTS = {isField: false, isAnswered: answer => answer !== null, problem: () => "", position: () => 0, move: () => {}};

/** A question as an element; `.answer` is null while it is not answered. */
export function question(spec, t) {
  const renderer = {...DEFAULTS, ...RENDERERS[spec.renderer] || RENDERERS.text}, id = `q${++count}`, {isField} = renderer;
  const element = make(isField ? "div" : "fieldset", {class: "question"});
  const changed = value => { element.answer = value; element.dispatchEvent(new Event("answered", {bubbles: true})); };
  element.spec = spec; element.answer = spec.answer ?? null;
  const title = [make("span", {}, spec.question || spec.name), spec.required === false ? make("span", {class: "optional"}, ` (${t("web.optional")})`) : null];
  const body = renderer.draw({spec, id, t, answer: element.answer, changed});
  const problem = make("p", {class: "problem", id: `${id}-problem`, hidden: true});
  (isField ? body[0] : element).setAttribute("aria-describedby", problem.id);
  element.append(make(isField ? "label" : "legend", {for: isField && id}, ...title), ...body, problem);
  element.isAnswered = () => renderer.isAnswered(element.answer, spec);
  element.problem = () => spec.required !== false && !element.isAnswered() ? t("web.required")
    : element.answer === null ? "" : renderer.problem(element.answer, spec, t);
  element.position = () => renderer.position(element.answer, spec);
  element.move = action => renderer.move(element, action);
  element.setProblem = text => {
    problem.hidden = !text; problem.textContent = text;
    element.classList.toggle("wrong", Boolean(text));
    if (isField) body[0].setAttribute("aria-invalid", Boolean(text));
    for (const row of rowsOf(element)) row.classList.toggle("missing", Boolean(text) && !row.querySelector("input:checked"));
  };
  element.focusProblem = () => {
    const row = rowsOf(element).find(row => !row.querySelector("input:checked"));
    const first = (row || element).querySelector("input, textarea");
    if (first) first.focus();
  };
  return element;
}

/** Rows of a table of statements, without its head. */
const rowsOf = element => [...element.querySelectorAll(".row[role=radiogroup]")];

/** A range without a value until it is touched. */
function slider({spec, id, t, answer, changed}) {
  const input = make("input", {type: "range", min: 0, max: 1, step: .01, id, "aria-label": `${spec.question}: ${spec.ends[0]} – ${spec.ends[1]}`});
  input.value = answer === null ? .5 : answer;
  input.classList.toggle("unset", answer === null);
  const hint = make("p", {class: "hint"}, answer === null ? t("question.no_value") : "");
  const set = () => { input.classList.remove("unset"); hint.textContent = ""; changed(Number(input.value)); };
  input.addEventListener("input", set); input.addEventListener("pointerup", set);
  input.addEventListener("keydown", event => { if (event.key === " ") { event.preventDefault(); set(); } });
  return [make("div", {class: "slider"}, make("span", {}, spec.ends[0]), input, make("span", {}, spec.ends[1])), hint];
}

/** A table with one scale for all rows; each row is a group of radio buttons. Ends that all rows share stand above them. */
function table({spec, id, answer, changed}) {
  const answers = {...answer}, points = Array.from({length: spec.points}, (_, k) => k + 1);
  const rows = spec.items.map((item, row) => {
    const ends = item.ends || spec.ends || ["", ""], label = item.text || `${ends[0]} – ${ends[1]}`;
    const set = value => { answers[item.name] = value; changed({...answers}); };
    const pairs = points.map(k => [k, spec.labels ? spec.labels[k - 1] : String(k)]);
    const inputs = choices(`${id}-${row}`, pairs, answers[item.name], set);
    inputs.forEach((choice, k) => {
      const text = pairs[k][1], end = k === 0 ? ends[0] : k === points.length - 1 ? ends[1] : "";
      choice.firstChild.setAttribute("aria-label", end && !spec.labels ? `${text}: ${end}` : text);
    });
    const side = k => item.ends && !spec.labels ? make("span", {class: "end"}, ends[k]) : null;
    return make("div", {class: item.ends ? "row opposites" : "row", role: "radiogroup", "aria-label": label},
      item.text ? make("div", {class: "statement"}, item.text) : null, make("div", {class: "points"}, side(0), ...inputs, side(1)));
  });
  const head = spec.ends && !spec.labels && spec.items.some(item => !item.ends)
    ? make("div", {class: "row head", "aria-hidden": "true"}, make("div"), make("div", {class: "ends"}, make("span", {}, spec.ends[0]), make("span", {}, spec.ends[1])))
    : null;
  return [make("div", {class: spec.labels ? "table named" : "table"}, head, ...rows)];
}

/** Questions with a button; `send` gets the answers by name. `answers` are filled in at first. */
export function form(specs, t, send, text, answers = {}) {
  const entries = specs.map(spec => question({...spec, answer: answers[spec.name]}, t));
  for (const entry of entries) entry.addEventListener("answered", () => { if (entry.isAnswered()) entry.setProblem(""); });
  const summary = make("p", {class: "problem", role: "alert", hidden: true});
  const element = make("form", {novalidate: true, onsubmit: event => {
    event.preventDefault();
    for (const entry of entries) entry.setProblem(entry.problem());
    const wrong = entries.filter(entry => entry.problem());
    summary.hidden = !wrong.length;
    if (!wrong.length) { send(element.answers()); return; }
    summary.textContent = t("web.missing", {count: wrong.length});
    wrong[0].focusProblem();
  }}, ...entries, summary, make("button", {class: "primary", type: "submit"}, text));
  element.answers = () => Object.fromEntries(entries.filter(entry => entry.answer !== null).map(entry => [entry.spec.name, entry.answer]));
  return element;
}
