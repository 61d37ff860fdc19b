// What the page with physics draws: MuJoCo's bodies, the string, and what a visitor points at.
//
// Points and directions that go in and out are MuJoCo's, in m. `scene` is the viewer's own.

const NEAR = [
  [0, 0],
  ...Array.from({ length: 8 }, (_, i) => [
    Math.cos((i * Math.PI) / 4),
    Math.sin((i * Math.PI) / 4),
  ]),
];

// Half the size of a tile over the distance of two, and colours of rough ground and of its tiles.
const TILE = 0.1,
  LIGHT = [0.72, 0.3],
  DARK = [0.07, 0.16];

// Share of the picture within which spots are drawn.
const EDGE = 0.94;

export class View {
  // facts: `page` of mjxgait/web/physics.py.
  constructor(viewer, overlay, facts) {
    Object.assign(this, { viewer, overlay, facts });
    this.scene =
      viewer[Object.getOwnPropertySymbols(viewer).find(symbol => symbol.description === "scene")];
    const found = name => this.scene.getObjectByName(name);
    [this.ground, this.world, this.floor] = ["ground", "world", "floor"].map(found);
    this.bodies = facts.bodies.map(body => [body, found(`body_${body}`)]);
    this.camera = this.scene.getCamera();
    this.Vector = this.camera.position.constructor;
    this.offset = null;
    this.dark = matchMedia("(prefers-color-scheme: dark)").matches;
    this.setFloor();
  }

  // Only the creature casts a shadow, which does not fade with the extent of the floor's tiles.
  setFloor() {
    const { scene, facts, floor, camera } = this,
      { shadow } = scene,
      reach = facts.extent;
    floor.traverse(part => {
      part.layers.set(1);
      if (this.dark && !facts.water) part.material?.color.setScalar(0.12);
    });
    camera.layers.enable(1);
    scene.boundingBox.min.set(-reach, 0, -reach);
    scene.boundingBox.max.set(reach, reach, reach);
    scene.boundingBox.getSize(scene.size);
    shadow.setScene(scene, scene.shadowSoftness, "bottom");
    this.ground.add(shadow);
    shadow.visible = !facts.water;
  }

  // Show rough ground in place of the tiles, or the tiles again.
  showGround(ground) {
    this.floor.visible = !ground.size;
    if (this.rough) this.rough.visible = ground.size > 0;
    if (!ground.size || this.shown === ground.version) return;
    this.shown = ground.version;
    this.rough ??= this.surface(ground.count);
    const { position, color } = this.rough.geometry.attributes,
      points = ground.points(),
      looks = this.dark ? DARK : LIGHT,
      { apart } = this.facts,
      far = value => Math.abs(value - apart * Math.round(value / apart));
    points.forEach(([x, y, z], n) => {
      const tile = ground.along(x, y).every(value => far(value) < TILE * apart);
      position.setXYZ(n, x, y, z);
      color.setXYZ(n, ...Array(3).fill(looks[Number(tile)]));
    });
    position.needsUpdate = color.needsUpdate = true;
    this.rough.geometry.computeVertexNormals();
  }

  // A surface of `count` by `count` points in MuJoCo's axes, of the viewer's own classes.
  surface(count) {
    let tiles = null;
    this.floor.traverse(part => (tiles = part.isMesh ? part : tiles));
    const { geometry, material } = tiles,
      Attribute = geometry.attributes.position.constructor,
      made = new geometry.constructor(),
      mesh = new tiles.constructor(made, material.clone()),
      faces = [];
    for (let row = 0; row + 1 < count; row++)
      for (let n = row * count; n + 1 < (row + 1) * count; n++)
        faces.push(n, n + 1, n + count, n + 1, n + count + 1, n + count);
    for (const name of ["position", "color"])
      made.setAttribute(name, new Attribute(new Float32Array(3 * count ** 2), 3));
    made.setIndex(new Attribute(new Uint32Array(faces), 1));
    mesh.material.color.setScalar(1);
    Object.assign(mesh.material, { vertexColors: true, needsUpdate: true });
    mesh.layers.set(1);
    mesh.frustumCulled = false;
    this.world.add(mesh);
    return mesh;
  }

  // Draw the present state. follow: whether the camera goes along. seconds: since the last drawing.
  draw(simulation, follow, seconds) {
    const { data, model } = simulation,
      { trunk, start, water } = simulation.facts;
    const [x, y, z] = data.xpos.slice(3 * trunk, 3 * trunk + 3);
    const place = this.vector(x, y, water ? z - start.place[2] : 0);
    this.offset ??= place.clone();
    if (follow) this.offset.lerp(place, 1 - Math.exp(-seconds / 0.15));
    for (const [body, node] of this.bodies) {
      node.position.fromArray(data.xpos, 3 * body);
      const [w, x, y, z] = data.xquat.slice(4 * body, 4 * body + 4);
      node.quaternion.set(x, y, z, w);
    }
    const axes = this.world.quaternion,
      here = place.applyQuaternion(axes);
    this.world.position.copy(this.offset).applyQuaternion(axes).negate();
    // The floor's pattern stays where it is in the world; its patch goes along with the creature.
    const tile = value => this.facts.apart * Math.round(value / this.facts.apart);
    this.floor.position.set(...here.toArray().map(tile)).add(this.world.position);
    if (simulation.ground) this.showGround(simulation.ground);
    // The ground is level where gravity says; in water there is none.
    const down = this.vector(...model.opt.gravity).applyQuaternion(axes).normalize();
    if (!water) this.ground.quaternion.setFromUnitVectors(down, this.vector(0, -1, 0));
    const { shadow } = this.scene,
      beside = here.add(this.world.position);
    // A flat shadow: no hill below the creature hides it.
    const floors = this.bodies.map(([body]) => simulation.floorAt(data.xpos.slice(3 * body)));
    shadow.position.set(beside.x, Math.max(...floors), beside.z);
    shadow.needsUpdate = true;
    this.scene.queueRender();
  }

  // Look at the creature again at once, as after a restart.
  recentre() {
    this.offset = null;
  }

  vector(x, y, z) {
    return new this.Vector(x, y, z);
  }

  // The ray from the camera through a place on the screen: its origin and unit direction, [3] each.
  ray(clientX, clientY) {
    const box = this.viewer.getBoundingClientRect();
    const screen = [
      (2 * (clientX - box.left)) / box.width - 1,
      1 - (2 * (clientY - box.top)) / box.height,
    ];
    const end = this.world.worldToLocal(this.vector(...screen, 0.5).unproject(this.camera));
    const eye = this.world.worldToLocal(this.camera.getWorldPosition(this.vector(0, 0, 0)));
    return { origin: eye.toArray(), direction: end.sub(eye).normalize().toArray() };
  }

  // Body, point and distance of what is at a place on the screen, or `reach` pixels beside it.
  pick(simulation, clientX, clientY, reach) {
    const { mujoco, model, data } = simulation,
      geom = new mujoco.IntBuffer(1);
    try {
      for (const [x, y] of NEAR) {
        const { origin, direction } = this.ray(clientX + reach * x, clientY + reach * y);
        const far = mujoco.mj_ray(model, data, origin, direction, null, false, -1, geom, null);
        if (far < 0) continue;
        const body = model.geom_bodyid[geom.GetView()[0]];
        return { body, point: origin.map((value, i) => value + far * direction[i]), far };
      }
    } finally {
      geom.delete();
    }
    return null;
  }

  // The point under a place on the screen that is as far from the camera as asked.
  at(clientX, clientY, far) {
    const { origin, direction } = this.ray(clientX, clientY);
    return origin.map((value, i) => value + far * direction[i]);
  }

  // Pixels [2] of a point, from the viewer's upper left corner.
  pixel(point) {
    const seen = this.world.localToWorld(this.vector(...point)).project(this.camera);
    return [
      ((seen.x + 1) / 2) * this.viewer.clientWidth,
      ((1 - seen.y) / 2) * this.viewer.clientHeight,
    ];
  }

  // Draw a line between two points, or none. Its class is its look.
  line(name, ends) {
    const line = this.overlay.querySelector(`line.${name}`);
    line.style.visibility = ends ? "visible" : "hidden";
    if (!ends) return;
    const [[x1, y1], [x2, y2]] = ends.map(end => this.pixel(end));
    for (const [key, value] of Object.entries({ x1, y1, x2, y2 })) line.setAttribute(key, value);
  }

  // Draw a spot at a point, or none; at the edge if the point is out of view. Its class is its look.
  spot(name, point) {
    const spot = this.overlay.querySelector(`circle.${name}`);
    spot.style.visibility = point ? "visible" : "hidden";
    if (!point) return;
    const seen = this.world.localToWorld(this.vector(...point)).project(this.camera);
    // Behind the camera, everything is seen upside down.
    const way = seen.z > 1 ? [-seen.x, -seen.y] : [seen.x, seen.y];
    const far = Math.max(...way.map(Math.abs)),
      share = seen.z > 1 || far > EDGE ? EDGE / far : 1;
    spot.setAttribute("cx", ((share * way[0] + 1) / 2) * this.viewer.clientWidth);
    spot.setAttribute("cy", ((1 - share * way[1]) / 2) * this.viewer.clientHeight);
  }
}
