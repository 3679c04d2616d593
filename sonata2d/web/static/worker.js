// The simulator in a page: starts Python, and passes the messages of the page on to `sonata2d.web.in_page`.

import {loadPyodide} from "./pyodide/pyodide.mjs";

const waiting = [];      // messages that came before the simulator could answer
let answer = null;

onmessage = event => { if (answer) postMessage(answer(event.data)); else waiting.push(event.data); };

const place = new URL("./", import.meta.url);
const tell = part => postMessage(JSON.stringify({type: "loading", part}));

async function start() {
  const load = async name => {
    const response = await fetch(new URL(name, place));
    if (!response.ok) throw new Error(`${name}: ${response.status} ${response.statusText}`);
    return response;
  };
  tell("python");
  const lock = await (await load("pyodide/pyodide-lock.json")).json();
  const python = await loadPyodide({indexURL: new URL("pyodide/", place).href, packages: Object.keys(lock.packages)});
  tell("simulator");
  const packages = python.runPython("import site; site.getsitepackages()[0]");
  python.unpackArchive(await (await load("sonata2d.zip")).arrayBuffer(), "zip", {extractDir: packages});
  const simulator = python.runPython("from sonata2d.web.in_page import PageSimulator; PageSimulator()");
  answer = text => simulator.answer(text);
  postMessage(JSON.stringify({type: "ready"}));
  for (const text of waiting.splice(0)) postMessage(answer(text));
}
start().catch(error => postMessage(JSON.stringify({type: "failed", text: String(error.message || error)})));
