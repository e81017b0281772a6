/* The view of a page: a mesh in one or more states side by side, which turns, is cut, and tells of the element clicked.

The page holds a record of JSON (report/view.py writes it). Its arrays are zlib-compressed and in base64. All
states have the same cells; they differ in points and values. One canvas lies behind the panes, one camera serves
all of them, so they turn together. An element is hidden by the cut if its centroid lies before the plane, so that
whole elements are seen, and by the filter if it is better than the value chosen.

Only what can be seen is drawn: faces of the boundary, and faces between an element that is shown and one that may be
hidden. The second kind needs no table of neighbours: a face is drawn if each of its vertices belongs to some hidden
element. A few faces between two shown elements come along; they lie inside and are not seen. */
"use strict";

const PICKED = "#000000"; // the edges of the element picked
const LIST = 10; // elements in the list of the worst
const CLICK = 4; // pixels that a click may wander
const NEAR = 10; // an element that is gone to is this many times smaller than the pane

const VERTEX_SHADER = `
attribute vec3 colour;
attribute vec3 side;
varying vec3 vColour;
varying vec3 vSide;
varying vec3 vPlace;
void main() {
  vec4 place = modelViewMatrix * vec4(position, 1.0);
  vColour = colour;
  vSide = side;
  vPlace = place.xyz;
  gl_Position = projectionMatrix * place;
}`;

/* Faces are lit from the viewer's side. A side of a face is where a component of vSide is 0; lines along the sides
fade where faces become as small as they are wide. */
const FRAGMENT_SHADER = `
uniform float opacity;
varying vec3 vColour;
varying vec3 vSide;
varying vec3 vPlace;
void main() {
  vec3 normal = normalize(cross(dFdx(vPlace), dFdy(vPlace)));
  vec3 lit = vColour * (0.7 + 0.3 * abs(normal.z));
  vec3 width = fwidth(vSide);
  vec3 pixels = vSide / max(width, vec3(1e-9));
  float near = 1.0 - smoothstep(0.4, 1.1, min(pixels.x, min(pixels.y, pixels.z)));
  float coarse = 1.0 - smoothstep(0.06, 0.3, max(width.x, max(width.y, width.z)));
  gl_FragColor = vec4(mix(lit, vec3(1.0), 0.8 * near * coarse), opacity);
}`;

async function unpack(text, Type) {
  const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Type(await new Response(stream).arrayBuffer());
}

/* The mesh of a record: its arrays unpacked, and for each cell its block. */
async function meshOf(record) {
  let first = 0;
  const blocks = [];
  for (const block of record.blocks) {
    const vertices = await unpack(block.vertices, Int32Array);
    const nodes = block.nodes;
    blocks.push({ ...block, vertices, first, count: vertices.length / nodes });
    first += vertices.length / nodes;
  }
  const states = [];
  for (const state of record.states) {
    const points = await unpack(state.points, Float32Array);
    states.push({ name: state.name, points, values: await unpack(state.values, Float32Array) });
  }
  return {
    ...record,
    blocks,
    states,
    count: first,
    ids: await unpack(record.ids, Int32Array),
    boundary: await unpack(record.boundary, Int32Array),
    kept: record.kept && (await unpack(record.kept, Uint8Array)),
    colours: await unpack(record.colours, Uint8Array),
  };
}

function blockOf(mesh, cell) {
  return mesh.blocks.find((block) => cell < block.first + block.count);
}

/* How good a value is: 1 at the good end of the scale, 0 at the bad one. */
function share(mesh, value) {
  const { good, bad } = mesh.scale;
  return (value - bad) / (good - bad);
}

/* The place of a cell: its centroid, and the distance of its farthest vertex from there. */
function placeOf(mesh, state, cell) {
  const block = blockOf(mesh, cell);
  const centroid = new THREE.Vector3();
  const corners = [];
  for (let k = 0; k < block.nodes; k++) {
    const vertex = block.vertices[(cell - block.first) * block.nodes + k];
    corners.push(new THREE.Vector3().fromArray(state.points, 3 * vertex));
    centroid.add(corners[k]);
  }
  centroid.divideScalar(block.nodes);
  return { centroid, corners, radius: Math.max(...corners.map((corner) => corner.distanceTo(centroid))) };
}

/* (n,) the extent of each cell's centroid along a normal. */
function heights(mesh, state, normal) {
  const along = new Float32Array(state.points.length / 3);
  for (let i = 0; i < along.length; i++) {
    const p = 3 * i;
    along[i] =
      normal.x * state.points[p] + normal.y * state.points[p + 1] + normal.z * state.points[p + 2];
  }
  const result = new Float32Array(mesh.count);
  for (const { vertices, nodes, first, count } of mesh.blocks) {
    for (let c = 0, i = 0; c < count; c++) {
      let sum = 0;
      for (let k = 0; k < nodes; k++) sum += along[vertices[i++]];
      result[first + c] = sum / nodes;
    }
  }
  return result;
}

/* (n,) which cells are shown. cut: { normal, offset } or null; limit: the share from which on cells are hidden. */
function shownCells(mesh, state, cut, limit) {
  const shown = new Uint8Array(mesh.count).fill(1);
  if (cut) {
    const height = heights(mesh, state, cut.normal);
    for (let c = 0; c < mesh.count; c++) if (height[c] > cut.offset) shown[c] = 0;
  }
  if (limit < 1) {
    for (let c = 0; c < mesh.count; c++) if (share(mesh, state.values[c]) > limit) shown[c] = 0;
  }
  return shown;
}

/* The faces that are drawn: pairs of cell and number of the face within it. */
function drawnFaces(mesh, shown, whole) {
  const faces = [];
  for (let i = 0; i < mesh.boundary.length; i += 2) {
    if (shown[mesh.boundary[i]]) faces.push(mesh.boundary[i], mesh.boundary[i + 1]);
  }
  if (whole || mesh.dimension === 2) return faces;
  const besideHidden = new Uint8Array(mesh.states[0].points.length / 3);
  for (const { vertices, nodes, first, count } of mesh.blocks) {
    for (let c = 0; c < count; c++) {
      if (!shown[first + c]) {
        for (let k = 0; k < nodes; k++) besideHidden[vertices[c * nodes + k]] = 1;
      }
    }
  }
  for (const block of mesh.blocks) {
    const { vertices, nodes, first, count } = block;
    for (let c = 0; c < count; c++) {
      if (!shown[first + c]) continue;
      block.faces.forEach((face, number) => {
        if (face.every((k) => besideHidden[vertices[c * nodes + k]])) faces.push(first + c, number);
      });
    }
  }
  return faces;
}

/* The geometry of faces, each as a fan of triangles; its triangles know their cells. */
function geometryOf(mesh, state, faces) {
  let triangles = 0;
  for (let i = 0; i < faces.length; i += 2) {
    triangles += blockOf(mesh, faces[i]).faces[faces[i + 1]].length - 2;
  }
  const position = new Float32Array(9 * triangles);
  const colour = new Uint8Array(9 * triangles);
  const side = new Uint8Array(9 * triangles);
  const cells = new Int32Array(triangles);
  let t = 0;
  for (let i = 0; i < faces.length; i += 2) {
    const cell = faces[i];
    const block = blockOf(mesh, cell);
    const face = block.faces[faces[i + 1]];
    const start = (cell - block.first) * block.nodes;
    const rgb = 3 * colourOf(mesh, state, cell);
    for (let k = 1; k + 1 < face.length; k++, t++) {
      const fan = [face[0], face[k], face[k + 1]];
      for (let v = 0; v < 3; v++) {
        const at = 9 * t + 3 * v;
        const from = 3 * block.vertices[start + fan[v]];
        for (let j = 0; j < 3; j++) {
          position[at + j] = state.points[from + j];
          colour[at + j] = mesh.colours[rgb + j];
          side[at + j] = v === j ? 1 : 0;
        }
        // a side within a face is nowhere near
        if (k > 1) side[at + 2] = 1;
        if (k + 2 < face.length) side[at + 1] = 1;
      }
      cells[t] = cell;
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  geometry.setAttribute("colour", new THREE.BufferAttribute(colour, 3, true));
  geometry.setAttribute("side", new THREE.BufferAttribute(side, 3));
  geometry.userData.cells = cells;
  return geometry;
}

/* The number of a cell's colour. After those of the scale come that of inverted cells and that of kept ones. */
function colourOf(mesh, state, cell) {
  const last = mesh.colours.length / 3 - 3;
  const good = share(mesh, state.values[cell]);
  if (mesh.scale.inverted && good < 0) return last + 1;
  if (mesh.kept && mesh.kept[cell]) return last + 2;
  return Math.round(last * Math.min(Math.max(good, 0), 1));
}

/* (LIST,) the worst cells of a state, worst first, equal ones by number. */
function worstCells(mesh, state) {
  const worst = [];
  for (let c = 0; c < mesh.count; c++) {
    const good = share(mesh, state.values[c]);
    if (worst.length === LIST && good >= worst[LIST - 1].good) continue;
    let place = worst.length;
    while (place > 0 && worst[place - 1].good > good) place--;
    worst.splice(place, 0, { cell: c, good });
    if (worst.length > LIST) worst.pop();
  }
  return worst.map((each) => each.cell);
}

function material(opacity) {
  return new THREE.ShaderMaterial({
    vertexShader: VERTEX_SHADER,
    fragmentShader: FRAGMENT_SHADER,
    side: THREE.DoubleSide,
    transparent: opacity < 1,
    depthWrite: opacity === 1,
    uniforms: { opacity: { value: opacity } },
  });
}

function element(tag, parent, attributes = {}, text = "") {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.textContent = text;
  parent.append(node);
  return node;
}

function figures(value) {
  return Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3)
    ? value.toExponential(2)
    : String(Number(value.toPrecision(4)));
}

/* One pane: a state of the mesh, drawn in its scene. */
class Pane {
  constructor(view, state) {
    this.view = view;
    this.state = state;
    this.scene = new THREE.Scene();
    const column = element("div", view.panes, { class: "pane" });
    this.title = element("h3", column, {}, state.name);
    this.frame = element("div", column, { class: "frame" });
    this.ring = element("div", this.frame, { class: "ring", hidden: "" });
    this.shownText = element("p", column, { class: "shown" });
    const all = drawnFaces(view.mesh, new Uint8Array(view.mesh.count).fill(1), true);
    this.ghost = new THREE.Mesh(geometryOf(view.mesh, state, all), material(0.12));
    this.solid = new THREE.Mesh(this.ghost.geometry, material(1));
    // the element picked, before all others
    this.body = new THREE.Mesh(new THREE.BufferGeometry(), material(0.99));
    this.body.material.depthTest = false;
    const lines = { color: PICKED, depthTest: false, transparent: true };
    this.outline = new THREE.LineSegments(new THREE.BufferGeometry(), new THREE.LineBasicMaterial(lines));
    this.body.renderOrder = 1;
    this.outline.renderOrder = 2;
    this.scene.add(this.ghost, this.solid, this.body, this.outline);
    this.list(column);
  }

  list(column) {
    const { mesh } = this.view;
    element("p", column, { class: "caption" }, `Worst elements by ${mesh.scale.label}`);
    const list = element("ol", column);
    for (const cell of worstCells(mesh, this.state)) {
      const button = element("button", element("li", list), { type: "button", "data-cell": mesh.ids[cell] });
      button.textContent = `${this.view.name(cell)}: ${this.view.text(this.state, cell)}`;
      button.addEventListener("click", () => this.view.goTo(this, cell));
    }
  }

  /* Show what the cut and the filter leave. */
  show(cut, limit) {
    const { mesh } = this.view;
    const shown = shownCells(mesh, this.state, cut, limit);
    const number = shown.reduce((sum, each) => sum + each, 0);
    const whole = number === mesh.count;
    if (this.solid.geometry !== this.ghost.geometry) this.solid.geometry.dispose();
    this.solid.geometry = whole
      ? this.ghost.geometry
      : geometryOf(mesh, this.state, drawnFaces(mesh, shown, false));
    this.ghost.visible = limit < 1;
    const said = [number, mesh.count].map((n) => n.toLocaleString("en"));
    this.shownText.textContent = `${said[0]} of ${said[1]} elements shown`;
    this.frame.dataset.triangles = this.solid.geometry.userData.cells.length;
  }

  /* The cell that is seen at a place of the window, or null. */
  cellAt(event) {
    const box = this.frame.getBoundingClientRect();
    const x = (2 * (event.clientX - box.left)) / box.width - 1;
    const y = 1 - (2 * (event.clientY - box.top)) / box.height;
    const caster = new THREE.Raycaster();
    caster.setFromCamera(new THREE.Vector2(x, y), this.view.camera);
    const [hit] = caster.intersectObject(this.solid);
    return hit ? this.solid.geometry.userData.cells[hit.faceIndex] : null;
  }

  pick(cell) {
    const { mesh } = this.view;
    this.picked = cell === null ? null : placeOf(mesh, this.state, cell);
    this.body.visible = this.outline.visible = this.picked !== null;
    if (!this.picked) return;
    const { faces, edges } = blockOf(mesh, cell);
    const ends = edges.flat().map((k) => this.picked.corners[k]);
    this.body.geometry.dispose();
    this.outline.geometry.dispose();
    this.body.geometry = geometryOf(mesh, this.state, faces.flatMap((_, number) => [cell, number]));
    this.outline.geometry = new THREE.BufferGeometry().setFromPoints(ends);
  }

  /* Draw into this pane's part of the canvas. */
  draw(renderer, canvas) {
    const box = this.frame.getBoundingClientRect();
    const x = box.left - canvas.left;
    const y = canvas.bottom - box.bottom;
    renderer.setViewport(x, y, box.width, box.height);
    renderer.setScissor(x, y, box.width, box.height);
    renderer.render(this.scene, this.view.camera);
    this.ring.hidden = !this.picked;
    if (this.picked) {
      const at = this.picked.centroid.clone().project(this.view.camera);
      const pixels = (this.picked.radius * this.view.camera.zoom * box.height) / (2 * this.view.height);
      const size = Math.min(Math.max(2.4 * pixels, 22), 400);
      const left = ((at.x + 1) / 2) * box.width - size / 2;
      const top = ((1 - at.y) / 2) * box.height - size / 2;
      this.ring.style.cssText = `left: ${left}px; top: ${top}px; width: ${size}px; height: ${size}px`;
    }
  }
}

class View {
  constructor(root, mesh) {
    this.mesh = mesh;
    this.root = root;
    this.due = {};
    this.canvas = element("canvas", root, { class: "canvas" });
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setScissorTest(true);
    this.tools = element("div", root, { class: "tools" });
    this.panes = element("div", root, { class: "panes" });
    this.measureBox();
    this.camera = new THREE.OrthographicCamera();
    this.panesOf = mesh.states.map((state) => new Pane(this, state));
    this.makeTools();
    this.makeControls();
    this.update();
    new ResizeObserver(() => this.resize()).observe(this.panes);
    this.resize();
  }

  text(state, cell) {
    const kept = this.mesh.kept && this.mesh.kept[cell] ? " (kept)" : "";
    return `${figures(state.values[cell])}${this.mesh.scale.unit}${kept}`;
  }

  name(cell) {
    return `${blockOf(this.mesh, cell).type} ${this.mesh.ids[cell]}`;
  }

  /* The box around all states, and the largest distance from its middle. */
  measureBox() {
    const low = new THREE.Vector3(Infinity, Infinity, Infinity);
    const high = low.clone().negate();
    const point = new THREE.Vector3();
    for (const { points } of this.mesh.states) {
      for (let i = 0; i < points.length; i += 3) {
        point.fromArray(points, i);
        low.min(point);
        high.max(point);
      }
    }
    this.low = low;
    this.high = high;
    this.middle = low.clone().add(high).divideScalar(2);
    this.size = high.distanceTo(low) / 2 || 1;
    this.corners = [0, 1, 2, 3, 4, 5, 6, 7].map(
      (k) => new THREE.Vector3(k & 1 ? high.x : low.x, k & 2 ? high.y : low.y, k & 4 ? high.z : low.z),
    );
  }

  makeTools() {
    const { mesh } = this;
    if (mesh.dimension === 3 || !mesh.planar) {
      const label = element("label", this.tools, {}, "Cut ");
      this.axis = element("select", label, { name: "axis" });
      for (const name of ["x", "y", "z", "towards me"]) element("option", this.axis, {}, name);
      this.place = element("input", label, { type: "range", name: "cut", min: 0, max: 1000, value: 1000 });
      for (const each of [this.axis, this.place]) each.addEventListener("input", () => this.soon("newCut"));
    }
    const label = element("label", this.tools, {}, "Worse than ");
    this.limit = element("input", label, { type: "range", name: "limit", min: 0, max: 1000, value: 1000 });
    this.limitText = element("output", label, { class: "limit" }, "all");
    this.limit.addEventListener("input", () => this.soon("update"));
    const reset = element("button", this.tools, { type: "button", name: "reset" }, "Reset");
    reset.addEventListener("click", () => this.reset());
    this.makeLegend();
    const drag = mesh.planar ? "Drag to move" : "Drag to turn, with the right button to move";
    this.hint = `${drag}, scroll to zoom, click an element to know it.`;
    this.said = element("output", this.tools, { class: "said" }, this.hint);
  }

  makeLegend() {
    const { scale, colours } = this.mesh;
    const last = colours.length / 3 - 3;
    const css = (k) => `rgb(${colours.slice(3 * k, 3 * k + 3).join()})`;
    const legend = element("span", this.tools, { class: "legend" });
    const swatch = (colour, text) => {
      element("i", legend, { class: "swatch", style: `background: ${css(colour)}` });
      element("span", legend, {}, text);
    };
    if (scale.inverted && this.mesh.states.some(({ values }) => values.some((value) => value < 0))) {
      swatch(last + 1, "inverted");
    }
    element("span", legend, {}, `${scale.label} ${figures(scale.bad)}${scale.unit}`);
    const stops = [0, 1, 2, 3, 4, 5, 6, 7, 8].map((k) => css(Math.round((last * k) / 8)));
    element("i", legend, { class: "bar", style: `background: linear-gradient(to right, ${stops.join()})` });
    element("span", legend, {}, `${figures(scale.good)}${scale.unit}`);
    if (this.mesh.kept) swatch(last + 2, "kept");
  }

  makeControls() {
    const { camera, mesh } = this;
    this.from = mesh.planar ? new THREE.Vector3(0, 0, 1) : new THREE.Vector3(0.52, -0.74, 0.43).normalize();
    camera.up.set(0, mesh.planar ? 1 : 0, mesh.planar ? 0 : 1);
    this.placeCamera();
    let target;
    this.controls = this.panesOf.map((pane) => {
      const controls = new THREE.OrbitControls(camera, pane.frame);
      if (target) controls.target = target; // one for all panes: they move together
      else controls.target.copy(this.middle);
      target = controls.target;
      if (mesh.planar) {
        controls.enableRotate = false;
        controls.mouseButtons.LEFT = THREE.MOUSE.PAN;
      }
      controls.addEventListener("change", () => this.request());
      let down = null;
      pane.frame.addEventListener("pointerdown", (event) => (down = event));
      pane.frame.addEventListener("pointerup", (event) => {
        if (down && Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) < CLICK) {
          this.pick(pane.cellAt(event));
        }
        down = null;
      });
      return controls;
    });
    this.target = target;
    for (const controls of this.controls) controls.update();
  }

  placeCamera() {
    this.camera.position.copy(this.from).multiplyScalar(4 * this.size).add(this.middle);
    this.camera.lookAt(this.middle);
    this.camera.zoom = 1;
    this.camera.near = 0;
    this.camera.far = 10 * this.size;
  }

  /* The direction in which the cut hides. */
  normal() {
    const { selectedIndex } = this.axis;
    if (selectedIndex === 3) return this.camera.position.clone().sub(this.target).normalize();
    // of both directions of an axis the one that opens the mesh to the viewer
    const axis = new THREE.Vector3().setComponent(selectedIndex, 1);
    return this.camera.position.clone().sub(this.target).dot(axis) < 0 ? axis.negate() : axis;
  }

  /* The extent of the mesh along a normal. */
  extent(normal) {
    const heights = this.corners.map((corner) => corner.dot(normal));
    return [Math.min(...heights), Math.max(...heights)];
  }

  /* Call a method before the next frame, once however often a slider moves until then. */
  soon(method) {
    this.due[method] ??= requestAnimationFrame(() => {
      this.due[method] = null;
      this[method]();
    });
  }

  newCut() {
    const part = this.place.value / 1000;
    const normal = this.normal();
    const [low, high] = this.extent(normal);
    this.cut = part < 1 ? { normal, offset: low + part * (high - low) } : null;
    this.update();
  }

  update() {
    const limit = this.limit.value / 1000;
    const { good, bad, unit } = this.mesh.scale;
    this.limitText.textContent = limit < 1 ? `${figures(bad + limit * (good - bad))}${unit}` : "all";
    for (const pane of this.panesOf) pane.show(this.cut, limit);
    this.request();
  }

  pick(cell) {
    for (const pane of this.panesOf) pane.pick(cell);
    const told = () => this.mesh.states.map((state) => `${state.name} ${this.text(state, cell)}`).join(", ");
    const { label } = this.mesh.scale;
    this.said.textContent = cell === null ? this.hint : `${this.name(cell)}, ${label}: ${told()}`;
    this.request();
  }

  /* Bring an element of a pane to the middle, larger, with what hides it cut away. */
  goTo(pane, cell) {
    this.pick(cell);
    const { centroid, radius } = pane.picked;
    this.camera.position.add(centroid.clone().sub(this.target));
    this.target.copy(centroid);
    this.camera.zoom = Math.max(1, this.height / (NEAR * radius || 1));
    this.camera.updateProjectionMatrix();
    for (const controls of this.controls) controls.update();
    if (this.mesh.dimension === 3 && this.mesh.inside) {
      this.axis.selectedIndex = 3;
      const normal = this.normal();
      const [low, high] = this.extent(normal);
      const offset = centroid.dot(normal) + 1e-5 * (high - low);
      this.place.value = Math.min(999, (1000 * (offset - low)) / (high - low));
      this.cut = { normal, offset };
    }
    this.limit.value = 1000;
    this.update();
  }

  reset() {
    this.cut = null;
    if (this.place) this.place.value = 1000;
    this.limit.value = 1000;
    this.target.copy(this.middle);
    this.placeCamera();
    for (const controls of this.controls) controls.update();
    this.pick(null);
    this.update();
    this.resize();
  }

  resize() {
    const box = this.root.getBoundingClientRect();
    this.renderer.setSize(box.width, box.height, false);
    const { width, height } = this.panesOf[0].frame.getBoundingClientRect();
    const aspect = width / height;
    const span = this.mesh.planar ? this.high.clone().sub(this.low) : null;
    const fit = span ? Math.max(span.y, span.x / aspect) / 2 : this.size * Math.max(1, 1 / aspect);
    this.height = 1.06 * fit || 1; // half of what a pane shows from top to bottom
    Object.assign(this.camera, { top: this.height, bottom: -this.height });
    Object.assign(this.camera, { left: -this.height * aspect, right: this.height * aspect });
    this.camera.updateProjectionMatrix();
    this.request();
  }

  request() {
    this.waiting ??= requestAnimationFrame(() => {
      this.waiting = null;
      const canvas = this.canvas.getBoundingClientRect();
      for (const pane of this.panesOf) pane.draw(this.renderer, canvas);
    });
  }
}

(async () => {
  const root = document.getElementById("view");
  try {
    const mesh = await meshOf(JSON.parse(document.getElementById("mesh").textContent));
    root.textContent = "";
    new View(root, mesh);
    root.dataset.ready = "true";
  } catch (error) {
    root.textContent = `This browser cannot show the mesh to be turned (${error.message}); the pictures are below.`;
  }
})();
