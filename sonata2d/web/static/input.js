// Keyboard, mouse, touch and game pads as device events, under the names that the window uses.

const JITTER = .01;              // smaller changes of an axis are noise
const RADIUS = .22;              // drag for a full deflection, as a fraction of the picture's smaller side
const DEAD_ZONE = {mouse: .08, touch: .08, pad: .1}, CENTRED = .25, PRESSED = .55;
const DRIVING_KEYS = ["w", "a", "s", "d", "q", "e", "up", "down", "left", "right", "space"];
const KEY_NAMES = {" ": "space", ArrowUp: "up", ArrowDown: "down", ArrowLeft: "left", ArrowRight: "right"};
const WHEEL_STEP = 100;          // of a mouse wheel, for one step of a label
const PAD_AXES = ["left_x", "left_y", "right_x", "right_y"];
const PAD_BUTTONS = ["a", "b", "x", "y", "left_shoulder", "right_shoulder", "left_trigger", "right_trigger", "back", "start",
  "left_stick", "right_stick", "dpad_up", "dpad_down", "dpad_left", "dpad_right"];   // of the standard mapping
const STICKS = [["drag_x", "drag_y"], ["left_x", "left_y"], ["right_x", "right_y"], ["axis0", "axis1"]];
const BRAKES = ["space", "left_shoulder"];

/** Collects values of controls between two polls; each control yields at most one event per poll. */
export class EventBuffer {
  constructor() { this.values = new Map(); this.reported = new Map(); this.changed = new Set(); this.taps = new Map(); }

  put(device, control, value, isButton = false) {
    const key = device + "/" + control;
    if (isButton && value) this.taps.set(key, value);
    this.values.set(key, value);
    this.changed.delete(key); this.changed.add(key);
  }

  /** Changes since the previous poll; a button pressed and released in between is released by the next poll. */
  poll() {
    const events = [], again = new Set();
    for (const key of this.changed) {
      const reported = this.reported.get(key) || 0;
      let value = this.values.get(key);
      if (value === 0 && reported === 0 && this.taps.has(key)) { value = this.taps.get(key); again.add(key); }
      if (value !== reported && (Math.abs(value - reported) >= JITTER || [-1, 0, 1].includes(value))) {
        const [device, control] = key.split("/");
        events.push({device, control, value});
        this.reported.set(key, value);
      }
    }
    this.changed = again; this.taps.clear();
    return events;
  }

  release() {
    for (const [key, value] of this.values) {
      this.taps.delete(key);
      if (value || this.reported.get(key)) { this.values.set(key, 0); this.changed.add(key); }
    }
  }

  /** The server has released all controls. */
  forget() { this.values.clear(); this.reported.clear(); this.changed.clear(); this.taps.clear(); }

  get(device, control) { return this.values.get(device + "/" + control) || 0; }
}

/** All devices of a page; `act` is called with the name of an action. */
export class Input {
  constructor(canvas, act) {
    this.canvas = canvas; this.act = act; this.buffer = new EventBuffer();
    this.stick = null;            // while the picture is dragged: pointer, device, anchor and position in pixels
    this.isActive = () => true;   // whether keys drive; else they belong to the page
    this.ignored = new Set();     // controls of pads that were deflected when all controls were released
    this.held = new Set();        // buttons of pads
    this.turned = 0;              // of the mouse wheel, since the last step
    this.pressed = new Map();     // names of the keys that are pressed, by their place on the keyboard
    addEventListener("keydown", event => this.key(event, 1));
    addEventListener("keyup", event => this.key(event, 0));
    addEventListener("blur", () => this.release());
    for (const type of ["pointerdown", "pointermove", "pointerup", "pointercancel"]) {
      canvas.addEventListener(type, event => this.pointer(event));
    }
    canvas.addEventListener("contextmenu", event => event.preventDefault());
    canvas.addEventListener("wheel", event => this.wheel(event), {passive: false});
    addEventListener("gamepaddisconnected", event => this.losePad(event.gamepad));
  }

  // -- keyboard

  key(event, value) {
    if (!event.key || (value && event.isComposing)) return;
    if (event.key === "Meta" && value) this.release();      // macOS does not report keys that are released meanwhile
    let name = KEY_NAMES[event.key] || event.key.toLowerCase();
    if (!/^[\x20-\x7f]+$/.test(name) || event.key === "Process") {      // a letter of another alphabet: the key by its place
      const letter = /^Key([A-Z])$/.exec(event.code);
      if (letter) name = letter[1].toLowerCase();
    }
    const place = event.code || event.key.toLowerCase();
    if (value) this.pressed.set(place, name);
    else { name = this.pressed.get(place) || name; this.pressed.delete(place); }   // Shift may have changed it
    if (value && (event.ctrlKey || event.altKey || event.metaKey)) {
      if (event.ctrlKey && name === "z" && this.isActive()) { event.preventDefault(); this.act("undo"); }
      return;
    }
    if (DRIVING_KEYS.includes(name)) {
      if (value && !this.isActive(event)) return;
      if (value) event.preventDefault();
      if (!event.repeat) this.buffer.put("keyboard", name, value, true);
    } else if (value && !event.repeat && this.isActive(event)) {
      const action = {enter: "confirm", backspace: "discard", r: "redo", p: "pause", escape: "pause", v: "view", z: "zones", h: "readings", f1: "help",
        "+": "zoomIn", "-": "zoomOut", pageup: "labelUp", pagedown: "labelDown"}[name] || (/^[1-9]$/.test(name) && "label" + name);
      if (action && this.act(action)) event.preventDefault();
    }
  }

  // -- mouse and touch: a stick where the picture is pressed

  pointer(event) {
    const device = event.pointerType === "touch" || event.pointerType === "pen" ? "touch" : "mouse";
    const box = this.canvas.getBoundingClientRect(), at = [event.clientX - box.left, event.clientY - box.top];
    if (event.type === "pointerdown") {
      if (this.stick || event.button !== 0 || !this.isActive()) return;
      event.preventDefault();
      this.canvas.focus({preventScroll: true});      // so that keys drive, too
      this.canvas.setPointerCapture(event.pointerId);
      this.stick = {id: event.pointerId, device, anchor: at, position: at, radius: Math.max(RADIUS * Math.min(box.width, box.height), 40)};
    } else if (!this.stick || this.stick.id !== event.pointerId) {
      return;
    } else if (event.type === "pointermove") {
      this.stick.position = at;
    } else {
      const released = this.stick;
      this.stick = null;
      for (const control of ["drag_x", "drag_y"]) this.buffer.put(released.device, control, 0);
      return;
    }
    const {anchor, position, radius} = this.stick, clip = value => Math.min(Math.max(value, -1), 1);
    this.buffer.put(this.stick.device, "drag_x", clip((position[0] - anchor[0]) / radius));
    this.buffer.put(this.stick.device, "drag_y", clip((position[1] - anchor[1]) / radius));
  }

  wheel(event) {
    if (event.ctrlKey || !this.isActive()) return;      // with Ctrl, the browser zooms
    this.turned += event.deltaMode ? Math.sign(event.deltaY) * WHEEL_STEP : event.deltaY;
    if (Math.abs(this.turned) < WHEEL_STEP) return;
    const isUsed = this.act(this.turned < 0 ? "labelUp" : "labelDown");
    this.turned = 0;
    if (isUsed) event.preventDefault();
  }

  // -- game pads

  pads() {
    const pads = navigator.getGamepads ? [...navigator.getGamepads()].filter(pad => pad && pad.index < 8) : [];
    pads.forEach(pad => {
      const isStandard = pad.mapping === "standard", device = "pad" + pad.index;
      pad.axes.forEach((value, k) => this.axis(device, isStandard ? PAD_AXES[k] : "axis" + k, value));
      pad.buttons.forEach((button, k) => this.button(device, isStandard ? PAD_BUTTONS[k] : "button" + k, button.value));
    });
  }

  /** Releases the controls of a pad that was disconnected. */
  losePad({index, id}) {
    const isOfPad = key => key.startsWith(`pad${index}/`);
    for (const key of this.buffer.values.keys()) if (isOfPad(key)) this.buffer.put(...key.split("/"), 0);
    for (const keys of [this.ignored, this.held]) for (const key of [...keys]) if (isOfPad(key)) keys.delete(key);
    this.act("padLost", id);
  }

  axis(device, control, value) {
    const key = device + "/" + control;
    if (!control) return;
    if (this.ignored.has(key)) { if (Math.abs(value) < CENTRED) this.ignored.delete(key); return; }
    if (Math.abs(value - this.buffer.get(device, control)) >= JITTER) this.buffer.put(device, control, Math.min(Math.max(value, -1), 1));
  }

  button(device, control, value) {
    const key = device + "/" + control, isPressed = value > PRESSED;
    if (!control || isPressed === this.held.has(key)) return;
    if (isPressed) this.held.add(key); else this.held.delete(key);
    const action = {a: "confirm", b: "discard", x: "redo", back: "undo", start: "pause", right_stick: "view", left_stick: "readings",
      dpad_up: "labelUp", dpad_down: "labelDown", right_trigger: "labelUp", left_trigger: "labelDown"}[control];
    if (control === "left_shoulder") this.buffer.put(device, control, +isPressed, true);
    else if (action && isPressed && this.isActive()) this.act(action);
  }

  // -- all

  poll() { return this.buffer.poll(); }

  /** Sets all controls to zero; a key has to be pressed again, and a stick has to be centred first. */
  release() {
    this.stick = null;
    for (const [key, value] of this.buffer.values) if (key.startsWith("pad") && value) this.ignored.add(key);
    this.buffer.release();
  }

  /** Whether any control demands a motion. */
  isDriving() {
    const {values} = this.buffer;
    for (const [key, value] of [...values, ...this.buffer.taps]) {
      const [device, control] = key.split("/"), zone = DEAD_ZONE[device.replace(/\d/g, "")] || 0;
      if (!value || BRAKES.includes(control)) continue;
      const stick = STICKS.find(pair => pair.includes(control));
      if (!stick || Math.hypot(...stick.map(name => values.get(device + "/" + name) || 0)) > zone) return true;
    }
    return false;
  }
}
