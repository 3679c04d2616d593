// Draws a scene on a canvas as the window does: metres, world frame, y up. scene_data.py makes the data.

const GAZE_RANGE = .75, GAZE_RAYS = [-3, -2, -1, 0, 1, 2, 3].map(k => .38 * k / 3);   // m beyond the outline; rad
const VIEW_RANGE = 5, DOWN = .72;           // of the follow view: m to the upper edge; position of the robot from the top
const TURN = 1.3;                           // least gain in scale by which a room is turned in the top view
const MARGIN = .3;                          // m, around the room in the top view
export const TRAIL = 61;                    // ticks of past paths
const SYMBOL_SCALE = 100;                   // pixels per metre

// ---- states between two ticks

const blend = (a, b, s) => a + (b - a) * s;
const turn = (a, b, s) => a + Math.atan2(Math.sin(b - a), Math.cos(b - a)) * s;

/** A row (x, y, theta, ...) between two ticks; further values come from the earlier one. */
function pose(a, b, s) {
  return a && (b ? [blend(a[0], b[0], s), blend(a[1], b[1], s), turn(a[2], b[2], s), ...a.slice(3)] : a);
}

/** What is drawn at a moment between two states of a scene; s from 0 (before) to 1 (after). */
export function stateBetween(scene, before, after, s) {
  const people = scene.humans.map((human, n) => {
    const now = pose(before.people[n], after.people[n], s);
    if (!now) return null;
    const next = after.people[n] || now, [x, y, theta, head, speed, activity] = now;
    return {...human, x, y, theta, head: turn(head, next[3], s), speed, activity: scene.activities[activity]};
  }).filter(Boolean);
  const [x, y, theta, ahead, left, omega] = pose(before.robot, after.robot, s);
  const robots = (scene.robots || []).map((robot, n) => {
    const [x, y, theta, ahead, left, omega, touches] = pose(before.robots[n], after.robots[n], s);
    return {...robot, isRobot: true, x, y, theta, ahead, left, omega, touches};
  });
  const doors = (before.doors || []).map((leaf, n) => leaf.map((value, k) => blend(value, after.doors[n][k], s)));
  return {people, robots, doors, goal: before.goal || scene.goal, links: before.links, time: blend(before.time, after.time, s),
          robot: {id: 0, isRobot: true, radius: scene.robotRadius, x, y, theta, ahead, left, omega, touches: before.touches}};
}

// ---- cameras: scale in pixels per metre, the world point at the upper left corner, the direction that points up

/** The whole room in a picture of a size in pixels; above zoom 1, its part around a place. A long room is turned by a
    quarter if it is then a good deal larger, as on a phone. */
export function topCamera(scene, width, height, zoom = 1, place = null) {
  const {left, top, width: wide, height: high} = scene.view;
  const upright = Math.min(width / wide, height / high), turned = Math.min(width / high, height / wide);
  const isTurned = turned > TURN * upright, fit = isTurned ? turned : upright, scale = fit * zoom;
  const corner = (low, size, pixels, at) => {
    const seen = pixels / scale, start = low + (size - pixels / fit) / 2, end = start + pixels / fit - seen;
    return zoom <= 1 || !place ? low + (size - seen) / 2 : Math.min(Math.max(at - seen / 2, start), end);
  };
  if (isTurned) return {scale, up: [1, 0], width, height, left: -corner(-left - wide, wide, height, place && -place.x),
                        top: -corner(-top, high, width, place && -place.y)};
  return {scale, up: [0, 1], width, height, left: corner(left, wide, width, place && place.x),
          top: -corner(-top, high, height, place && -place.y)};
}

/** A camera between two of the same picture, which keeps a place of the world in between, too; s from 0 to 1. */
export function cameraBetween(a, b, {x, y}, s) {
  const angle = turn(Math.atan2(a.up[1], a.up[0]), Math.atan2(b.up[1], b.up[0]), s), ux = Math.cos(angle), uy = Math.sin(angle);
  const scale = Math.exp(blend(Math.log(a.scale), Math.log(b.scale), s)), from = toPixels(a, x, y), to = toPixels(b, x, y);
  const right = blend(from[0], to[0], s) / scale, down = blend(from[1], to[1], s) / scale;
  return {scale, up: [ux, uy], width: b.width, height: b.height, left: x - right * uy + down * ux, top: y + right * ux + down * uy};
}

/** From behind the robot, whose direction points up. */
function followCamera(robot, width, height, zoom = 1) {
  const range = VIEW_RANGE / zoom, scale = DOWN * height / range, half = width / 2 / scale;
  const ux = Math.cos(robot.theta), uy = Math.sin(robot.theta);
  return {scale, up: [ux, uy], width, height,
          left: robot.x + range * ux - half * uy, top: robot.y + range * uy + half * ux};
}

/** Pixels right of and below the upper left corner, of a world point. */
export function toPixels(camera, x, y) {
  const [ux, uy] = camera.up, dx = x - camera.left, dy = camera.top - y;
  return [(dx * uy + dy * ux) * camera.scale, (dy * uy - dx * ux) * camera.scale];
}

/** Size of a canvas on the page, px; it gets as many pixels as the screen has there. */
export function fitted(canvas) {
  const {clientWidth: width, clientHeight: height} = canvas, fine = devicePixelRatio || 1;
  const wide = Math.round(width * fine), high = Math.round(height * fine);
  if (canvas.width !== wide || canvas.height !== high) { canvas.width = wide; canvas.height = high; }
  return {width, height};
}

// ---- drawing

/** The shapes of a symbol: an SVG of SYMBOL_SCALE pixels per metre, ahead to the right and left up. */
function shapesOf(svg) {
  const shapes = new DOMParser().parseFromString(svg, "text/html").querySelectorAll("circle, polygon, polyline");
  return [...shapes].map(shape => {
    const value = name => shape.getAttribute(name), path = new Path2D();
    if (shape.tagName === "circle") path.arc(value("cx"), value("cy"), value("r"), 0, 2 * Math.PI);
    else for (const point of value("points").split(" ")) path.lineTo(...point.split(","));
    if (shape.tagName === "polygon") path.closePath();
    return {path, fill: value("fill"), stroke: value("stroke"), width: value("stroke-width")};
  });
}

export class SceneDrawing {
  /** A scene; `ready` is called when its room can be drawn. */
  constructor(scene, ready = () => {}) {
    this.scene = scene;
    this.symbols = Object.fromEntries(Object.entries(scene.symbols).map(([name, svg]) => [name, shapesOf(svg)]));
    this.room = new Image();
    this.room.onload = ready;
    this.room.src = scene.room;
    this.cache = null;                     // the room at the present scale
  }

  /** The camera of a view, "follow" or "top"; without a recorded robot there is nothing to follow. */
  cameraOf(view, now, width, height, zoom = 1) {
    const isTop = view === "top" || !this.known("robot");
    return isTop ? topCamera(this.scene, width, height, zoom, now.robot) : followCamera(now.robot, width, height, zoom);
  }

  known(name) { return !this.scene.unmeasured.includes(name); }

  /** Fills the canvas with a state; `trails` are rows of past positions, the latest last. */
  draw(pen, camera, now, {layers = {}, trails = [], outside = null, finish = () => {}} = {}) {
    this.pen = pen; this.camera = camera;
    const fine = pen.canvas.width / camera.width, {scale, left, top, up: [ux, uy]} = camera, s = scale * fine;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    if (outside) { pen.fillStyle = outside; pen.fillRect(0, 0, pen.canvas.width, pen.canvas.height); }
    else pen.clearRect(0, 0, pen.canvas.width, pen.canvas.height);
    pen.setTransform(s * uy, -s * ux, -s * ux, -s * uy, s * (ux * top - uy * left), s * (uy * top + ux * left));
    this.drawRoom(s);
    for (const leaf of now.doors) this.drawLeaf(leaf);
    if (layers.goal !== false && this.known("goal")) {
      for (const robot of now.robots) this.drawWay(robot);
      this.place("goal", now.goal[0], now.goal[1]);
    }
    for (const trail of trails) this.drawTrail(trail);
    const robots = this.known("robot") ? [...now.robots, now.robot] : [];
    const places = Object.fromEntries([...this.scene.things, ...now.people, ...robots].map(item => [item.id, item]));
    if (layers.zones) this.inRoom(() => this.zoned(now, layers.zones).forEach(human => this.drawZones(human)));
    if (layers.gaze !== false && this.known("heads")) now.people.forEach(human => this.drawGaze(human, now.doors));
    if (layers.links !== false) now.links.forEach(link => this.drawLink(link, places));
    now.people.forEach(human => this.drawHuman(human, now.time));
    for (const {id, x, y, theta, touches} of robots) this.place((touches ? "touching" : "robot") + (id ? ` ${id}` : ""), x, y, theta);
    pen.setTransform(fine, 0, 0, fine, 0, 0);
    for (const item of Object.values(places)) {
      const words = [layers.ids ? item.id : "", layers.attributes === false ? "" : item.words].filter(word => word || word === 0);
      if (words.length) this.drawWords(item, words.join("  "));
    }
    if (layers.attributes !== false) for (const area of this.scene.areas) this.drawWords(area, area.words);
    finish(pen, camera);
  }

  // -- shapes in the local frame of an agent: metres, x ahead, y left

  at(x, y, theta, draw) { const {pen} = this; pen.save(); pen.translate(x, y); pen.rotate(theta); draw(); pen.restore(); }

  /** Draws a symbol of the scene at a pose, magnified. */
  place(name, x, y, theta = 0, size = 1) {
    const {pen} = this;
    this.at(x, y, theta, () => {
      pen.scale(size / SYMBOL_SCALE, -size / SYMBOL_SCALE); pen.lineCap = pen.lineJoin = "round";
      for (const {path, fill, stroke, width} of this.symbols[name]) {
        if (fill !== "none") { pen.fillStyle = fill; pen.fill(path); }
        if (stroke) { pen.strokeStyle = stroke; pen.lineWidth = width; pen.stroke(path); }
      }
    });
  }

  /** The leaf of a door. */
  drawLeaf([x0, y0, x1, y1]) {
    const {pen, scene: {colours}} = this;
    for (const [colour, width] of [[colours.leafEdge, .07], [colours.leaf, .035]]) {
      pen.beginPath(); pen.moveTo(x0, y0); pen.lineTo(x1, y1); pen.strokeStyle = colour; pen.lineWidth = width; pen.stroke();
    }
  }

  /** The goal of a robot besides the first one, and the dashed line to it. */
  drawWay({id, x, y, goal}) {
    const {pen} = this;
    pen.beginPath(); pen.moveTo(x, y); pen.lineTo(goal[0], goal[1]);
    pen.globalAlpha = .35; pen.strokeStyle = this.scene.colours.goal; pen.lineWidth = .02; pen.setLineDash([.1, .1]); pen.stroke();
    pen.setLineDash([]); pen.globalAlpha = 1;
    this.place(`goal ${id}`, goal[0], goal[1]);
  }

  fill(colour, alpha = 1) { const {pen} = this; pen.globalAlpha = alpha; pen.fillStyle = colour; pen.fill(); pen.globalAlpha = 1; }

  line(colour, width, dash = []) {
    const {pen} = this;
    pen.lineCap = dash.length ? "butt" : "round"; pen.lineJoin = "round"; pen.setLineDash(dash);
    pen.strokeStyle = colour; pen.lineWidth = width; pen.stroke(); pen.setLineDash([]); pen.globalAlpha = 1;
  }

  round(a, b, x = 0, y = 0) { this.pen.beginPath(); this.pen.ellipse(x, y, a, b, 0, 0, 2 * Math.PI); }

  /** All within r of the shoulder line, which lies across the heading, or along it if it is negative. */
  body(r, shoulder) {
    const {pen} = this;
    if (shoulder < 0) {
      pen.beginPath(); pen.arc(-shoulder, 0, r, -Math.PI / 2, Math.PI / 2); pen.arc(shoulder, 0, r, Math.PI / 2, 1.5 * Math.PI);
      return pen.closePath();
    }
    pen.beginPath(); pen.arc(0, shoulder, r, 0, Math.PI); pen.arc(0, -shoulder, r, Math.PI, 2 * Math.PI); pen.closePath();
  }

  path(...points) { this.pen.beginPath(); for (const [x, y] of points) this.pen.lineTo(x, y); }

  polygon(...points) { this.path(...points); this.pen.closePath(); }

  // -- what does not move

  /** The room, from a picture of it at the present scale, which is kept until the scale changes. */
  drawRoom(scale) {
    const {pen, room} = this, {left, top, width, height} = this.scene.view;
    if (!room.complete || !room.naturalWidth) return;
    const limit = Math.min(scale, 4096 / Math.max(width, height));
    if (!this.cache || Math.abs(this.cache.scale / limit - 1) > .02) {
      const canvas = document.createElement("canvas");
      canvas.width = Math.max(Math.round(width * limit), 1); canvas.height = Math.max(Math.round(height * limit), 1);
      canvas.getContext("2d").drawImage(room, 0, 0, canvas.width, canvas.height);
      this.cache = {scale: limit, canvas};
    }
    pen.save(); pen.translate(left, top); pen.scale(1, -1);
    pen.drawImage(this.cache.canvas, 0, 0, width, height);
    pen.restore();
  }

  inRoom(draw) {
    const {pen} = this;
    pen.save();
    const {outline, holes} = this.scene;
    if (outline.length) {
      this.polygon(...outline);
      for (const hole of holes) { hole.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y)); pen.closePath(); }
      pen.clip("evenodd");
    }
    draw(); pen.restore();
  }

  // -- what moves

  drawHuman(human, time) {
    const tones = this.scene.tones[human.activity], {shoulder, place = 0} = human, limbs = human.limbs || human.activity;
    const [radius, half] = human.figure || [human.radius, Math.max(shoulder, 0)], size = radius + half / 2;
    const isPlain = !this.known("headings");
    this.at(human.x, human.y, human.theta, () => {
      this.body(human.radius, shoulder);
      if (human.ignores) {
        this.fill(isPlain ? tones.plain : tones.body);
        const length = 2 * Math.PI * human.radius + 4 * Math.abs(shoulder);
        this.line(tones.dark, .033, [length / 18, length / 18]);
      } else {
        this.fill(tones.outline); this.body(human.radius - .022, shoulder); this.fill(isPlain ? tones.plain : tones.body);
      }
      if (isPlain) return;
      if (human.kit) this.place(human.kit, 0, 0);
      this.at(place, 0, 0, () => {
        const {stride, aside} = this.scene.steps[limbs] ?? {};
        if (stride) {
          const swing = Math.sin(Math.PI * time / .75 + human.id);
          for (const side of [-1, 1]) this.place(limbs, side * swing * stride * size, side * aside * size, 0, size);
        } else this.place(limbs, 0, 0, (this.scene.gestures[limbs] ?? 0) * Math.sin(Math.PI * time / .75 + human.id), size);
        this.round(.46 * size, .9 * (radius + half)); this.fill(tones.dark);
        this.round(.46 * size - .022, .9 * (radius + half) - .022); this.fill(tones.fill);
      });
    });
    if (isPlain) return;
    const hasHead = this.known("heads");
    const x = human.x + place * Math.cos(human.theta), y = human.y + place * Math.sin(human.theta);
    this.place(hasHead ? "head" : "round head", x, y, hasHead ? human.head : human.theta, size);
  }

  /** The field of view, which ends at walls. */
  drawGaze(human, doors) {
    const colour = this.scene.tones[human.activity].fill;
    const rays = GAZE_RAYS.map(angle => {
      const limit = human.radius + GAZE_RANGE, c = Math.cos(human.head + angle), s = Math.sin(human.head + angle);
      return [angle, Math.min(limit, ...[...this.scene.walls, ...doors].map(wall => this.distanceTo(wall, human, c, s)))];
    });
    const points = far => rays.map(([a, d]) => [Math.min(d, far) * Math.cos(a), Math.min(d, far) * Math.sin(a)]);
    const rim = points(Infinity), middle = points(human.radius + .66 * GAZE_RANGE);
    this.at(human.x, human.y, human.head, () => {
      this.polygon(...rim, ...[...middle].reverse()); this.fill(colour, 24 / 255);
      this.polygon([0, 0], ...middle); this.fill(colour, 55 / 255);
    });
  }

  /** Distance along a unit vector from a pedestrian to a wall, m. */
  distanceTo([x0, y0, x1, y1], human, c, s) {
    const ax = x1 - x0, ay = y1 - y0, ox = x0 - human.x, oy = y0 - human.y, cross = (c * ay - s * ax) || 1e-12;
    const distance = (ox * ay - oy * ax) / cross, fraction = (ox * s - oy * c) / cross;
    return distance > 0 && fraction >= 0 && fraction <= 1 ? distance : Infinity;
  }

  /** The people whose zones are drawn: the `count` that are nearest to the robot, or all if it is true. */
  zoned({people, robot}, count) {
    const distance = ({x, y}) => Math.hypot(x - robot.x, y - robot.y);
    return count === true ? people : [...people].sort((a, b) => distance(a) - distance(b)).slice(0, count);
  }

  drawZones(human) {
    const [intimate, personal] = this.scene.zones.map(distance => human.radius + distance), {colours} = this.scene;
    this.at(human.x, human.y, human.theta, () => {
      const length = 2 * Math.PI * personal + 4 * Math.abs(human.shoulder);
      this.body(personal, human.shoulder); this.fill(colours.zone, 13 / 255);
      this.line(colours.personalLine, .012, [length / 96, length / 96]);
      this.body(intimate, human.shoulder); this.fill(colours.zone, 17 / 255); this.line(colours.intimateLine, .012);
    });
  }

  drawLink([src, dst], places) {
    const a = places[src], b = places[dst];
    if (!a || !b) return;
    const distance = Math.hypot(b.x - a.x, b.y - a.y), from = a.radius + .05, to = distance - b.radius - .05;
    if (to > from) this.at(a.x, a.y, Math.atan2(b.y - a.y, b.x - a.x), () => {
      if (b.type !== undefined) { this.path([from, 0], [to, 0]); this.line(this.scene.colours.regard, .014); return; }      // a thing
      for (let x = from; x <= to; x += .1) { this.round(.022, .022, x); this.fill(this.scene.colours.link); }
    });
  }

  drawTrail({rows, colour, width}) {
    rows.forEach((row, i) => {
      if (!row || !rows[i - 1]) return;
      this.path(rows[i - 1], row);
      this.pen.globalAlpha = .55 * (1 - (rows.length - 1 - i) / TRAIL); this.line(colour, width, [9, 0]);
    });
  }

  drawWords(item, words) {
    const {pen, camera} = this, size = (item.words ? .13 : .17) * camera.scale, [x, y] = toPixels(camera, item.x, item.y);
    pen.font = `600 ${size}px system-ui, sans-serif`; pen.textAlign = "center"; pen.lineJoin = "round";
    const half = pen.measureText(words).width / 2, above = y - (item.radius + .06) * camera.scale;
    const isSeen = x > 0 && x < camera.width && y > 0 && y < camera.height;  // only then words are kept in the picture
    const label = [words, isSeen ? Math.max(half, Math.min(x, camera.width - half)) : x, isSeen ? Math.max(size, above) : above];
    pen.lineWidth = .06 * camera.scale; pen.strokeStyle = "#fff"; pen.strokeText(...label);
    pen.fillStyle = this.scene.colours.ink; pen.fillText(...label);
  }
}
