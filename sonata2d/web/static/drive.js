// Driving: requests each tick from the server, and draws the states smoothly.

import {SceneDrawing, cameraBetween, fitted, stateBetween, toPixels} from "./drawing.js";
import {Input} from "./input.js";

const MAX_TICKS = 3;          // requested for one picture, to catch up; further ticks are dropped and counted
const MAX_UNANSWERED = 15;    // ticks without an answer before the run is paused
const ZOOM_STEP = 1.25, MIN_ZOOM = .4, MAX_ZOOM = 3;
const OVERVIEW = 1.2, APPROACH = .6;      // s: a run begins with the whole room, from which the picture moves to the robot
const ZONED = 2;              // people whose personal space is drawn: in a crowd, all of them would cover the floor
const OUTSIDE = "#e2e5e9";
const isStill = matchMedia("(prefers-reduced-motion: reduce)").matches;

export class Drive {
  /** `send` sends a message; `changed` is called when the status changes; `act` is called with actions of the page. */
  constructor(canvas, {send, changed, act, isBlocked, goalText}) {
    this.canvas = canvas; this.pen = canvas.getContext("2d"); this.send = send; this.changed = changed; this.isBlocked = isBlocked; this.goalText = goalText;
    this.simulate = null;      // sends a message to a simulator in the page, once there is one; its answers go to `foreseen`
    this.input = new Input(canvas, (action, value) => this.perform(action) || act(action, value));
    this.view = "follow"; this.zoom = 1; this.zones = false; this.changes = []; this.overview = 0;
    this.status = "none"; this.run = null; this.states = new Map(); this.last = null; this.isSlow = false;
    requestAnimationFrame(now => this.frame(now));
  }

  /** Shows a run: the `drive` part of a view. */
  show(drive) {
    const isNew = this.run !== drive.run || !this.drawing;
    if (isNew) {
      this.drawing = new SceneDrawing(drive.scene, () => {});
      if (this.scenes !== drive.view) { this.view = drive.view; this.scenes = drive.view; }
      this.zoom = 1;
    }
    this.data = drive.scene; this.changes = drive.changes;
    if (isNew && !drive.ticks) this.overview = isStill ? OVERVIEW : OVERVIEW + APPROACH;      // s that are left
    this.run = drive.run; this.states = new Map([[drive.ticks, drive.state]]);
    if (drive.ticks && drive.status === "driving") this.states.set(drive.ticks - 1, drive.before);
    this.sent = this.latest = this.confirmed = this.shown = this.shownTicks = drive.ticks;
    this.followed = drive.status === "ended" ? null : drive.follow; this.own = new Map(); this.isPredicted = false; this.isDifferent = true;
    this.follow();
    this.sentAt = new Map(); this.lag = 0; this.dropped = 0; this.roundTrip = null; this.isSlow = false;
    this.input.buffer.forget();
    if (isNew) this.waitingLabel = null;
    this.status = "none";
    this.update(drive);
  }

  /** Lets the simulator in the page simulate the run as well, from where it is now; only before a tick is sent. */
  follow() {
    if (!this.simulate || !this.followed || this.sent !== this.shownTicks) return;
    this.isDifferent = false; this.simulated = this.sent;
    this.simulate({type: "follow", ...this.followed});
  }

  hide() { this.status = "none"; this.run = null; }

  /** An answer to a tick. */
  answered(answer) {
    if (answer.run !== this.run) return;
    const sentAt = this.sentAt.get(answer.asked);
    if (sentAt !== undefined) { this.roundTrip = (performance.now() - sentAt) / 1000; this.sentAt.delete(answer.asked); }
    this.confirmed = Math.max(this.confirmed, answer.ticks);
    const own = this.own.get(answer.ticks);
    this.own.delete(answer.ticks);
    if (!own) this.isPredicted = false;      // the server was faster
    else if (own !== JSON.stringify(answer.state)) this.differ();
    this.add(answer);
    this.update(answer);
  }

  /** A tick that the page has simulated itself. The server's state of the same tick has to be the same. */
  foreseen(answer) {
    if (answer.run !== this.run || this.isDifferent) return;
    this.simulated = answer.asked + 1;
    if (this.status !== "driving") return;
    if (answer.ticks <= this.confirmed) return;
    this.isPredicted = true;
    this.own.set(answer.ticks, JSON.stringify(answer.state));
    this.add(answer);
  }

  add({ticks, state}) {
    this.latest = Math.max(this.latest, ticks);
    this.states.set(ticks, state);
    this.states.delete(ticks - 100);
  }

  /** From now on, the run shows what the server simulates. */
  differ() {
    if (!this.own) return;
    this.isDifferent = true; this.isPredicted = false;
    for (const tick of this.own.keys()) this.states.delete(tick);
    this.own.clear();
    this.latest = this.confirmed; this.shown = Math.min(this.shown, this.latest);
  }

  update({status, outcome, broken, frameLabel, isUnsaved, isStudyPaused}) {
    const former = this.status, wasUnsaved = this.isUnsaved;
    if (former === "pausing" && status === "driving") return;   // the answer to a tick before the pause
    this.outcome = outcome; this.broken = broken; this.frameLabel = frameLabel; this.isUnsaved = isUnsaved; this.isStudyPaused = isStudyPaused;
    this.status = status;
    if (status === "ended") this.input.release();
    if (status !== former || isUnsaved !== wasUnsaved) this.changed();
  }

  /** Starts or continues. */
  start() {
    if (this.isStudyPaused || (this.status !== "waiting" && this.status !== "paused")) return;
    this.lag = 0; this.isSlow = false;
    this.status = "driving";
    this.tick();
    this.changed();
  }

  pause(isSlow = false) {
    if (this.status !== "driving") return;
    this.isSlow = isSlow;
    this.input.release();
    this.status = "pausing";     // until the answer of the server; no further tick is requested
    this.send({type: "pause", run: this.run});
    this.changed();
  }

  stop() {
    if (this.status !== "driving" && this.status !== "paused") return;
    this.status = "pausing";
    this.send({type: "stop", run: this.run});
  }

  /** Sends a label, as its position from 0 to 1, with the next tick. */
  label(position, answer) { this.waitingLabel = {answer, event: {device: "label", control: "value", value: position}}; }

  perform(action) {
    const allowed = {view: "view", zoomIn: "zoom", zoomOut: "zoom", zones: "zones"}[action];
    if (!allowed || !this.changes.includes(allowed)) return false;
    if (action === "view") this.view = this.view === "top" ? "follow" : "top";
    if (action === "zones") this.zones = !this.zones;
    if (allowed === "zoom") this.zoom = Math.min(Math.max(this.zoom * (action === "zoomIn" ? ZOOM_STEP : 1 / ZOOM_STEP), MIN_ZOOM), MAX_ZOOM);
    return true;
  }

  // -- time

  frame(now) {
    requestAnimationFrame(next => this.frame(next));
    const seconds = this.last === null ? 0 : (now - this.last) / 1000;
    this.last = now;
    if (this.run === null) return;
    this.input.pads();
    if (this.status === "driving") this.advance(seconds);
    else if ((this.status === "waiting" || this.status === "paused") && this.input.isActive() && this.input.isDriving()) this.start();
    this.draw(seconds);
  }

  advance(seconds) {
    const {dt} = this.data;
    if (this.isBlocked()) return;      // the awaited answer has the number of the next tick
    this.lag += seconds;
    for (let k = 0; k < MAX_TICKS && this.lag >= dt; k++) {
      if (this.sent - this.confirmed >= MAX_UNANSWERED) { this.pause(true); return; }
      this.lag -= dt;
      this.tick();
    }
    const dropped = Math.floor(this.lag / dt);
    this.lag -= dropped * dt; this.dropped += dropped;
  }

  tick() {
    const events = [...this.input.poll(), ...(this.waitingLabel ? [this.waitingLabel.event] : [])];
    const isSent = this.send({type: "tick", run: this.run, number: this.sent, events, round_trip: this.roundTrip, dropped: this.dropped, predicted: this.isPredicted});
    if (!isSent) return;
    if (!this.isDifferent) {
      if (this.sent - this.simulated < MAX_UNANSWERED) this.simulate({type: "tick", run: this.run, number: this.sent, events});
      else this.differ();      // it is slower than real time
    }
    this.waitingLabel = null;
    this.sentAt.set(this.sent, performance.now());
    this.sent++; this.dropped = 0; this.roundTrip = null;
  }

  // -- drawing

  /** The state on show: one to two ticks behind the latest one, so that late answers are not visible. */
  moment(seconds) {
    const behind = this.latest - 1 - this.shown, {dt} = this.data;
    if (this.status === "driving") this.shown += seconds / dt * (1 + .2 * Math.min(Math.max(behind, -3), 10));
    else this.shown += (this.latest - this.shown) * Math.min(seconds * 10, 1);
    this.shown = Math.min(this.shown, this.latest);
    if (this.latest - this.shown < .01) this.shown = this.latest;
    const first = Math.floor(this.shown), after = this.states.get(first + 1);
    const before = this.states.get(first) || after || this.states.get(this.latest);
    return stateBetween(this.data, before, after || before, after && before !== after ? this.shown - first : 0);
  }

  draw(seconds) {
    const {width, height} = fitted(this.canvas);
    if (!width || !height) return;
    const now = this.now = this.moment(seconds);
    const camera = this.camera(now, width, height, seconds);
    const tint = {waiting: "rgba(0,158,115,.09)", ended: "rgba(213,94,0,.09)"}[this.status];
    this.drawing.draw(this.pen, camera, now, {layers: {zones: this.zones && ZONED}, outside: OUTSIDE, finish: pen => {
      this.drawGoalArrow(pen, camera, now);
      if (tint) { pen.fillStyle = tint; pen.fillRect(0, 0, width, height); }
      this.drawStick(pen);
    }});
  }

  /** Whether the picture shows the whole room, before it moves to the robot: nothing should cover a part of it. */
  get isOverview() { return this.overview > APPROACH && this.view !== "top"; }

  /** The camera of the present view; at first the whole room, until the picture has moved to the robot or it drives. */
  camera(now, width, height, seconds) {
    const camera = this.drawing.cameraOf(this.view, now, width, height, this.zoom);
    if (this.status !== "waiting") this.overview = 0;
    if (this.overview <= 0 || this.view === "top") return camera;
    this.overview -= seconds;
    const whole = this.drawing.cameraOf("top", now, width, height), s = isStill ? 0 : 1 - Math.min(Math.max(this.overview / APPROACH, 0), 1);
    return cameraBetween(whole, camera, now.robot, s * s * (3 - 2 * s));
  }

  /** An arrow at the edge towards a goal outside the picture, with the distance. */
  drawGoalArrow(pen, camera, {robot}) {
    const [x, y] = this.data.goal, place = toPixels(camera, x, y), {width, height} = camera, edge = 26;
    this.isGoalBelow = place[1] > .6 * height;
    if (place[0] > 0 && place[0] < width && place[1] > 0 && place[1] < height) return;
    const middle = toPixels(camera, robot.x, robot.y), dx = place[0] - middle[0], dy = place[1] - middle[1];
    const limits = [dx > 0 ? (width - edge - middle[0]) / dx : dx < 0 ? (edge - middle[0]) / dx : Infinity,
                    dy > 0 ? (height - edge - middle[1]) / dy : dy < 0 ? (edge - middle[1]) / dy : Infinity];
    const share = Math.max(Math.min(...limits), 0);
    const tip = [middle[0] + dx * share, middle[1] + dy * share], length = Math.hypot(dx, dy) || 1;
    const label = this.goalText(Math.hypot(robot.x - x, robot.y - y));
    pen.save();
    pen.font = "600 15px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.lineJoin = "round"; pen.lineWidth = 4;
    const half = pen.measureText(label).width / 2 + 8;
    const spot = [Math.min(Math.max(tip[0] - (20 + half) * dx / length, half), width - half), Math.min(Math.max(tip[1] - 30 * dy / length, 14), height - 14)];
    pen.textAlign = "center"; pen.strokeStyle = "#fff"; pen.strokeText(label, ...spot); pen.fillStyle = this.data.colours.ink; pen.fillText(label, ...spot);
    pen.translate(...tip); pen.rotate(Math.atan2(dy, dx));
    pen.beginPath(); pen.moveTo(16, 0); pen.lineTo(-12, 13); pen.lineTo(-12, -13); pen.closePath();
    pen.fillStyle = this.data.colours.goal; pen.strokeStyle = "#fff"; pen.lineWidth = 2; pen.fill(); pen.stroke();
    pen.restore();
  }

  drawStick(pen) {
    const {stick} = this.input;
    if (!stick) return;
    const [x, y] = stick.anchor, dx = stick.position[0] - x, dy = stick.position[1] - y;
    const distance = Math.hypot(dx, dy), share = distance > 0 ? Math.min(stick.radius / distance, 1) : 1;
    pen.beginPath(); pen.arc(x, y, stick.radius, 0, 2 * Math.PI);
    pen.fillStyle = "rgba(255,255,255,.27)"; pen.fill(); pen.strokeStyle = this.data.colours.ink; pen.lineWidth = 2; pen.stroke();
    pen.beginPath(); pen.arc(x + dx * share, y + dy * share, stick.radius * .22, 0, 2 * Math.PI);
    pen.fillStyle = this.data.colours.ink; pen.fill();
  }

  /** Readings of the moment on show. */
  readings() {
    const {robot, time} = this.now, [x, y] = this.data.goal, latest = this.states.get(this.latest);
    return {time, speed: Math.hypot(robot.ahead, robot.left), goal: Math.hypot(robot.x - x, robot.y - y),
            nearest: latest ? latest.clearance : null, touches: robot.touches,
            hasArrived: Boolean(latest && latest.hasArrived)};
  }
}
