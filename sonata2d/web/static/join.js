// The page of the open link: a device that lacks something takes no place of the study.

import {lacking} from "./device.js";
import {byId, filled} from "./elements.js";

const {requires, words} = JSON.parse(byId("data").textContent);

function show() {
  const missing = lacking(requires, (key, values = {}) => filled(words[key] || key, values));
  byId("missing").textContent = missing;
  byId("join").hidden = Boolean(missing);
}
addEventListener("resize", show);
show();
