// Playback of a recorded run, which is watched to its end before it is rated.

import {SceneDrawing, fitted, stateBetween} from "./drawing.js";

export class Watch {
  /** `changed` is called while the run plays and when it has ended. */
  constructor(canvas, changed) {
    this.canvas = canvas; this.pen = canvas.getContext("2d"); this.changed = changed;
    this.shown = null; this.last = null;
    requestAnimationFrame(now => this.frame(now));
  }

  /** Shows a run: the `rating` part of a view. */
  show(rating) {
    if (this.shown === rating.shown) return;
    rating.states.forEach((state, k) => { state.links ??= rating.states[k - 1].links; });
    this.shown = rating.shown; this.data = rating.scene; this.states = rating.states; this.view = rating.view;
    this.drawing = new SceneDrawing(rating.scene);
    this.moment = 0; this.seconds = 0; this.isWhole = false; this.isPlaying = true;
    this.changed();
  }

  hide() { this.shown = null; }

  get end() { return this.states.length - 1; }

  play(isPlaying) {
    if (isPlaying && this.moment >= this.end) this.moment = 0;
    this.isPlaying = isPlaying;
    this.changed();
  }

  again() { this.moment = 0; this.play(true); }

  frame(now) {
    requestAnimationFrame(next => this.frame(next));
    const seconds = this.last === null ? 0 : (now - this.last) / 1000;
    this.last = now;
    if (this.shown === null) return;
    if (this.isPlaying && !document.hidden) {
      this.seconds += Math.min(seconds, .1);      // the time while the page was hidden does not count
      this.moment = Math.min(this.moment + Math.min(seconds, .1) / this.data.dt, this.end);
      if (this.moment >= this.end) { this.isPlaying = false; this.isWhole = true; }
      this.changed();
    }
    this.draw();
  }

  draw() {
    const {width, height} = fitted(this.canvas);
    if (!width || !height) return;
    const i = Math.min(Math.floor(this.moment + 1e-6), this.end), j = Math.min(i + 1, this.end);
    const now = stateBetween(this.data, this.states[i], this.states[j], Math.max(this.moment - i, 0));
    this.drawing.draw(this.pen, this.drawing.cameraOf(this.view, now, width, height), now, {outside: "#e2e5e9"});
  }
}
