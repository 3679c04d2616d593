// Forms: questions, tables, and labels of runs, from native elements, so that keyboards and screen readers know them.

import {make} from "./elements.js";

let count = 0;

/** Radio buttons in a row: a value of `values` for each of `texts`. */
function choices(name, values, texts, {chosen = null, changed = () => {}} = {}) {
  return values.map((value, k) => {
    const input = make("input", {type: "radio", name, id: `${name}-${k}`, value: k, onchange: () => changed(value)});
    input.checked = value === chosen;
    return make("label", {class: "choice", for: input.id}, input, make("span", {}, texts[k]));
  });
}

/** A question; `.answer` is null while it is not answered. */
export function question(spec, t) {
  const id = `q${++count}`;
  let answer = spec.answer === undefined ? null : spec.answer;
  const changed = value => { answer = value; element.dispatchEvent(new Event("answered", {bubbles: true})); };
  const title = [make("span", {}, spec.question || spec.name), spec.required === false ? make("span", {class: "optional"}, ` (${t("web.optional")})`) : null];
  let body;
  if (spec.kind === "likert") {
    body = table(spec, id, answer || {}, value => changed(value));
  } else if (spec.kind === "yes_no") {
    body = [make("div", {class: "choices"}, ...choices(id, [true, false], [t("question.yes"), t("question.no")], {chosen: answer, changed}))];
  } else if (spec.kind === "classes") {
    const values = spec.classes.map((_, k) => k + 1);
    body = [make("div", {class: "choices"}, ...choices(id, values, spec.classes, {chosen: answer, changed}))];
  } else if (spec.kind === "slider") {
    body = slider(spec, id, answer, changed, t);
  } else {
    const isNumber = spec.kind === "number";
    const field = make(isNumber ? "input" : "textarea", isNumber
      ? {type: "number", id, min: spec.minimum, max: spec.maximum, step: spec.integer ? 1 : "any", inputmode: spec.integer ? "numeric" : "decimal"}
      : {id, rows: 2, maxlength: 5000});
    if (answer !== null) field.value = answer;
    field.addEventListener("input", () => {
      const text = field.value.trim();
      changed(text === "" ? null : isNumber ? Number(text) : text);
    });
    body = [field];
  }
  const isField = spec.kind === "number" || spec.kind === "text";
  const problem = make("p", {class: "problem", id: `${id}-problem`, hidden: true});
  if (isField) body[0].setAttribute("aria-describedby", problem.id);
  const element = isField
    ? make("div", {class: "question"}, make("label", {for: id}, ...title), ...body, problem)
    : make("fieldset", {class: "question", "aria-describedby": problem.id}, make("legend", {}, ...title), ...body, problem);
  Object.defineProperty(element, "answer", {get: () => answer});
  element.spec = spec;
  element.isAnswered = () => spec.kind === "likert"
    ? spec.items.every(item => answer && answer[item.name]) : answer !== null;
  element.setProblem = text => {
    problem.hidden = !text; problem.textContent = text;
    element.classList.toggle("wrong", Boolean(text));
    if (isField) body[0].setAttribute("aria-invalid", Boolean(text));
    for (const row of rowsOf(element)) row.classList.toggle("missing", Boolean(text) && !row.querySelector("input:checked"));
  };
  element.focusProblem = () => {
    const row = rowsOf(element).find(one => !one.querySelector("input:checked"));
    const first = (row || element).querySelector("input, textarea");
    if (first) first.focus();
  };
  element.choose = value => {      // as if it had been clicked
    const inputs = [...element.querySelectorAll("input[type=radio]")];
    const values = spec.kind === "yes_no" ? [true, false] : (spec.classes || []).map((_, k) => k + 1);
    const input = inputs[values.indexOf(value)];
    if (input) { input.checked = true; changed(value); }
  };
  return element;
}

/** Rows of a table of statements, without its head. */
const rowsOf = element => [...element.querySelectorAll(".row[role=radiogroup]")];

/** A range without a value until it is touched. */
function slider(spec, id, answer, changed, t) {
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
function table(spec, id, given, changed) {
  const answers = {...given}, points = Array.from({length: spec.points}, (_, k) => k + 1);
  const rows = spec.items.map((item, row) => {
    const name = `${id}-${row}`, ends = item.ends || spec.ends || ["", ""];
    const label = item.text || `${ends[0]} – ${ends[1]}`;
    const set = value => { answers[item.name] = value; changed({...answers}); };
    const texts = points.map(k => spec.labels ? spec.labels[k - 1] : String(k));
    const inputs = choices(name, points, texts, {chosen: answers[item.name] ?? null, changed: set});
    inputs.forEach((choice, k) => {
      const input = choice.firstChild, end = k === 0 ? ends[0] : k === points.length - 1 ? ends[1] : "";
      input.setAttribute("aria-label", end && !spec.labels ? `${texts[k]}: ${end}` : texts[k]);
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

/** Questions with a button; `send` gets the answers by name. */
export function form(specs, t, send, text, given = {}) {
  const questions = specs.map(spec => question({...spec, answer: given[spec.name] ?? null}, t));
  for (const one of questions) one.addEventListener("answered", () => { if (one.isAnswered()) one.setProblem(""); });
  const summary = make("p", {class: "problem", role: "alert", hidden: true});
  const element = make("form", {novalidate: true, onsubmit: event => {
    event.preventDefault();
    const missing = questions.filter(one => {
      const isMissing = one.spec.required !== false && !one.isAnswered();
      const {minimum: low, maximum: high} = one.spec, value = one.answer;
      const isWrong = one.spec.kind === "number" && value !== null
        && (Number.isNaN(value) || (one.spec.integer && !Number.isInteger(value)) || (low != null && value < low) || (high != null && value > high));
      one.setProblem(isMissing ? t("web.required") : isWrong ? t(one.spec.integer ? "web.whole_number" : "web.wrong_number", {low: low ?? "…", high: high ?? "…"}) : "");
      return isMissing || isWrong;
    });
    summary.hidden = !missing.length;
    if (missing.length) {
      summary.textContent = t("web.missing", {count: missing.length});
      missing[0].focusProblem();
      return;
    }
    send(element.answers());
  }}, ...questions, summary, make("button", {class: "primary", type: "submit"}, text));
  element.answers = () => Object.fromEntries(questions.filter(one => one.answer !== null).map(one => [one.spec.name, one.answer]));
  return element;
}
