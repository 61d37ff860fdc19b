// Several creatures side by side in one scene: moves the parts that the GLB file holds.
//
// For the pages of `mjxgait gallery` and `mjxgait view`, which follow it in one module or import it.
// Places are glTF's, in m. `scene` is the viewer's own.

const FADE = 0.25; // Share of a member's space, at both ends, in which marks grow and vanish.
const NEAR = 5; // Distance of the camera from one member, in units of its half size.
const ASPECT = 1.6; // Width over height for which `far` is meant.

function make(kind, parent, className = "", text = "") {
  const element = document.createElement(kind);
  Object.assign(element, { className, textContent: text });
  parent.append(element);
  return element;
}

function floats(text) {
  const bytes = Uint8Array.from(atob(text), character => character.charCodeAt(0));
  return new Float32Array(bytes.buffer);
}

const wrapped = (value, half) => ((((value + half) % (2 * half)) + 2 * half) % (2 * half)) - half;

class Member {
  constructor(facts, scene, overlay) {
    Object.assign(this, facts);
    this.nodes = facts.parts.map(name => scene.getObjectByName(name));
    this.marked = facts.marks.map((_, mark) =>
      scene.getObjectByName(`mark_${facts.number}_${mark}`),
    );
    this.lit = scene.getObjectByName(`lamp_${facts.number}`);
    this.motion = floats(facts.motion);
    this.lamp = facts.lamp && floats(facts.lamp);
    this.frames = this.motion.length / (7 * this.nodes.length);
    this.label = make("div", overlay, "label", facts.strategy);
  }

  // Move all to seconds since the start; a loop repeats for ever.
  draw(seconds) {
    const share = (seconds / this.seconds) % 1,
      at = share * (this.frames - 1),
      frame = Math.min(Math.floor(at), this.frames - 2);
    this.nodes.forEach((node, part) => this.pose(node, part, frame, at - frame));
    this.marked.forEach((node, mark) => {
      const [x, y, z] = this.marks[mark],
        half = this.half[2],
        now = wrapped(z - (this.flow * seconds) / this.seconds, half);
      node.position.set(this.middle[0] + x, this.level + y, this.middle[2] + now);
      node.scale.setScalar(Math.max(Math.min((half - Math.abs(now)) / (FADE * half), 1), 1e-3));
    });
    if (!this.lamp) return;
    const place = [0, 1, 2].map(i => {
      const before = this.lamp[3 * frame + i];
      return this.middle[i] + before + (at - frame) * (this.lamp[3 * frame + 3 + i] - before);
    });
    this.lit.position.set(...place);
  }

  pose(node, part, frame, share) {
    const width = 7 * this.nodes.length,
      first = frame * width + 7 * part,
      value = i => this.motion[first + i] + share * (this.motion[first + width + i] - this.motion[first + i]);
    node.position.set(this.middle[0] + value(0), this.level + value(1), this.middle[2] + value(2));
    node.quaternion.set(value(3), value(4), value(5), value(6)).normalize();
  }
}

export class School {
  constructor(facts, parent, number) {
    this.facts = facts;
    this.stage = make("div", parent, "stage");
    const viewer = (this.viewer = make("model-viewer", this.stage, facts.water ? "water" : "sand"));
    viewer.id = number ? `walk_${number}` : "walk";
    const settings = {
      "alt": facts.water ? "swimmers side by side" : "creatures on sand, side by side",
      "camera-controls": "",
      "field-of-view": "30deg",
      "min-field-of-view": "30deg",
      "min-camera-orbit": "auto auto 0.1m",
      "max-camera-orbit": `auto ${facts.water ? 175 : 89}deg ${6 * facts.far}m`,
      "exposure": "0.95",
      "shadow-intensity": facts.water ? "0" : "0.8",
      "shadow-softness": "0.7",
      "interaction-prompt": "none",
      "touch-action": "pan-y",
      "disable-tap": "",
    };
    for (const [name, value] of Object.entries(settings)) viewer.setAttribute(name, value);
    make("div", viewer).slot = "progress-bar";
    this.overlay = make("div", this.stage);
    this.card = make("div", this.stage, "card");
    this.card.hidden = true;
    this.members = [];
    viewer.addEventListener("load", () => this.begin());
    this.lookAtAll();
    viewer.src = `data:model/gltf-binary;base64,${facts.glb}`;
  }

  begin() {
    const { viewer, facts } = this;
    const own = Object.getOwnPropertySymbols(viewer).find(one => one.description === "scene");
    this.scene = viewer[own];
    this.camera = this.scene.getCamera();
    this.members = facts.members.map(one => new Member(one, this.scene, this.overlay));
    // Land creatures keep their height above the sand.
    for (const member of this.members) member.level = facts.water ? member.middle[1] : 0;
    if (!facts.water) this.setSand();
    viewer.addEventListener("pointermove", event => this.point(event));
    viewer.addEventListener("pointerleave", () => this.show(null));
    viewer.addEventListener("pointerdown", event => (this.pressed = [event.clientX, event.clientY]));
    viewer.addEventListener("pointerup", event => this.released(event));
  }

  // The sand casts no shadow, and the shadows reach no farther than the creatures.
  setSand() {
    const { scene, facts, camera } = this,
      { min, max } = scene.boundingBox;
    scene.getObjectByName("sand").traverse(part => part.layers.set(1));
    scene.getObjectByName("sand").position.y = -0.002 * facts.far;
    camera.layers.enable(1);
    const reach = axis => facts.members.map(one => [one.middle[axis] - one.half[axis], one.middle[axis] + one.half[axis]]).flat();
    min.set(Math.min(...reach(0)), 0, Math.min(...reach(2)));
    max.set(Math.max(...reach(0)), Math.max(...reach(1)), Math.max(...reach(2)));
    scene.boundingBox.getSize(scene.size);
    scene.shadow.setScene(scene, scene.shadowSoftness, "bottom");
  }

  draw(seconds) {
    if (!this.members.length) return;
    for (const member of this.members) {
      member.draw(seconds);
      const [x, y] = this.foot(member);
      member.label.style.transform = `translate(${x}px, ${y}px) translate(-50%, -110%)`;
    }
    if (this.shown) this.placeCard(this.shown);
    if (!this.facts.water) this.scene.shadow.needsUpdate = true;
    this.scene.queueRender();
  }

  // Pixels [2] of the middle of a member's lower edge.
  foot(member) {
    return this.facts.water
      ? this.pixel(member, 0, -member.half[1])
      : this.pixel(member, -member.half[0], -member.middle[1]);
  }

  // Pixels [2] of a member's middle, or of a place beside it.
  pixel(member, aside = 0, up = 0) {
    const [x, y, z] = member.middle,
      { clientWidth, clientHeight } = this.viewer;
    const seen = this.camera.position.clone().set(x + aside, y + up, z);
    // The viewer moves what it shows, such that the target is at its origin.
    this.members[0].nodes[0].parent.localToWorld(seen).project(this.camera);
    return [((seen.x + 1) / 2) * clientWidth, ((1 - seen.y) / 2) * clientHeight];
  }

  // The member under a place on the screen, or null.
  at(clientX, clientY) {
    const box = this.viewer.getBoundingClientRect(),
      here = [clientX - box.left, clientY - box.top];
    let nearest = null,
      least = 1;
    for (const member of this.members) {
      const middle = this.pixel(member),
        [right] = this.pixelAlong(member),
        wide = Math.abs(right - middle[0]) || 1,
        apart = Math.hypot(here[0] - middle[0], here[1] - middle[1]) / wide;
      if (apart < least) [nearest, least] = [member, apart];
    }
    return nearest;
  }

  pixelAlong(member) {
    const [x, y, z] = member.middle;
    return this.pixel({ middle: [x, y, z + member.half[2]] });
  }

  point(event) {
    this.show(event.buttons ? this.shown : this.at(event.clientX, event.clientY));
  }

  // A click or a tap, unless the pointer was dragged.
  released(event) {
    const [x, y] = this.pressed ?? [0, 0];
    if (Math.hypot(event.clientX - x, event.clientY - y) > 6) return;
    const member = this.at(event.clientX, event.clientY);
    this.show(member);
    member ? this.lookAt(member) : this.lookAtAll();
  }

  show(member) {
    this.shown = member;
    this.card.hidden = !member;
    if (!member) return;
    this.card.replaceChildren();
    make("b", this.card, "", `${member.name}: ${member.strategy}`);
    make("span", this.card, "", member.does);
    make("br", this.card);
    make("span", this.card, member.certified ? "" : "fails", member.verdict);
    this.placeCard(member);
  }

  // Below the member, where it hides none of it.
  placeCard(member) {
    const [x, y] = this.foot(member),
      { offsetWidth, offsetHeight } = this.card,
      { clientWidth, clientHeight } = this.viewer;
    const left = Math.max(Math.min(x - offsetWidth / 2, clientWidth - offsetWidth - 8), 8),
      top = Math.max(Math.min(y, clientHeight - offsetHeight - 8), 8);
    this.card.style.transform = `translate(${left}px, ${top}px)`;
  }

  lookAt(member) {
    this.aim(member.middle, NEAR * Math.max(...member.half));
  }

  lookAtAll() {
    const { clientWidth, clientHeight } = this.viewer;
    const narrow = clientHeight ? Math.max(ASPECT / (clientWidth / clientHeight), 1) : 1;
    this.aim(this.facts.target, this.facts.far * narrow);
  }

  aim(target, far) {
    const { azimuth, polar } = this.facts;
    this.viewer.cameraTarget = target.map(place => `${place}m`).join(" ");
    this.viewer.cameraOrbit = `${azimuth}deg ${polar}deg ${far}m`;
  }
}
