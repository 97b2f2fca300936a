// The map in three dimensions. Without positions: the directions that the camera has looked in, on a sphere.

const kSegmentColors = ['blue', 'orange', 'violet'];  // by kind: translating, rotating, still

class Scene {
  constructor(box) {
    this.box = box;
    this.up = this.findUp();
    this.scene = new THREE.Scene();
    this.world = new THREE.Group();
    this.world.quaternion.setFromUnitVectors(this.up, new THREE.Vector3(0, 1, 0));
    this.world.updateMatrixWorld(true);
    this.scene.add(this.world);
    this.layers = {};
    this.path = hasPositions ? frames.position : this.viewingDirections();
    this.frameBounds();
    this.addAll();
    this.startRenderer();
    this.setColors();
    this.look();
    this.setFrame(0);
  }

  rotationOf(place) {
    return new THREE.Quaternion().fromArray(frames.quaternion, 4 * place).normalize();
  }

  centerOf(place) {
    return hasPositions ? new THREE.Vector3().fromArray(frames.position, 3 * place) : new THREE.Vector3();
  }

  // Against the mean of the cameras' downward axes; a camera upright at its start where they cancel.
  findUp() {
    const sum = new THREE.Vector3();
    for (let k = 0; k < numFrames; ++k) sum.add(new THREE.Vector3(0, -1, 0).applyQuaternion(this.rotationOf(k)));
    return sum.length() > 0.2 * numFrames ? sum.normalize() : new THREE.Vector3(0, -1, 0);
  }

  viewingDirections() {
    const path = new Float32Array(3 * numFrames);
    for (let k = 0; k < numFrames; ++k) {
      new THREE.Vector3(0, 0, 1).applyQuaternion(this.rotationOf(k)).toArray(path, 3 * k);
    }
    return path;
  }

  // What the first view shall hold: the whole path, and the cloud without its far points.
  frameBounds() {
    const points = [];
    const add = (x, y, z) => points.push(this.world.localToWorld(new THREE.Vector3(x, y, z)));
    const step = Math.max(1, Math.floor(numFrames / 500));
    for (let k = 0; k < numFrames; k += step) add(...this.path.slice(3 * k, 3 * k + 3));
    if (!hasPositions) for (const s of [-1, 1]) points.push(new THREE.Vector3(s, s, s));
    this.numPathPoints = points.length;
    const path = new THREE.Box3().setFromPoints(points);
    if (hasPositions && cloud && cloud.position.length > 0) {
      const sample = [];
      const every = 3 * Math.max(1, Math.floor(cloud.position.length / 9000));
      for (let k = 0; k + 2 < cloud.position.length; k += every) {
        sample.push(this.world.localToWorld(new THREE.Vector3().fromArray(cloud.position, k)));
      }
      const share = (axis, part) => {
        const sorted = sample.map((point) => point[axis]).sort((a, b) => a - b);
        return sorted[Math.floor(part * (sorted.length - 1))];
      };
      const low = new THREE.Vector3(share('x', 0.12), share('y', 0.12), share('z', 0.12));
      const high = new THREE.Vector3(share('x', 0.88), share('y', 0.88), share('z', 0.88));
      for (const point of sample) {
        if (['x', 'y', 'z'].every((axis) => point[axis] >= low[axis] && point[axis] <= high[axis])) points.push(point);
      }
    }
    this.shown = points;
    const box = new THREE.Box3().setFromPoints(points);
    this.middle = box.getCenter(new THREE.Vector3());
    this.radius = Math.max(1e-6, 0.5 * box.getSize(new THREE.Vector3()).length());
    this.pathSize = Math.max(1e-6, path.getSize(new THREE.Vector3()).length());
  }

  layer(name, label, colorName, object, shown = true) {
    object.visible = shown;
    this.world.add(object);
    this.layers[name] = {label, colorName, object, shown};
    return object;
  }

  geometry(positions) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(positions), 3));
    return geometry;
  }

  lines(positions, opacity = 1) {
    return new THREE.LineSegments(this.geometry(positions),
      new THREE.LineBasicMaterial({transparent: opacity < 1, opacity}));
  }

  // Round ones of so many pixels.
  dots(positions, size) {
    if (!this.disc) {
      const canvas = h('canvas', {width: 64, height: 64});
      const context = canvas.getContext('2d');
      context.fillStyle = '#fff';
      context.arc(32, 32, 31, 0, 7);
      context.fill();
      this.disc = new THREE.CanvasTexture(canvas);
    }
    return new THREE.Points(this.geometry(positions), new THREE.PointsMaterial(
      {size: size * Math.min(2, window.devicePixelRatio || 1), sizeAttenuation: false, map: this.disc, alphaTest: 0.5}));
  }

  addAll() {
    if (cloud && hasPositions) this.addCloud();
    if (!hasPositions) this.addSphere();
    this.addPath();
    if (hasPositions && truth && truth.position) this.addTruth();
    this.addFrusta();
    if (hasPositions) this.addLoops();
    this.addMarker();
  }

  addCloud() {
    const geometry = this.geometry(cloud.position);
    geometry.setAttribute('color', new THREE.BufferAttribute(cloud.rgb, 3, true));
    const material = new THREE.PointsMaterial({size: 1.6, sizeAttenuation: false, vertexColors: THREE.VertexColors});
    this.layer('cloud', 'cloud', 'muted', new THREE.Points(geometry, material));
  }

  addSphere() {
    const ring = [];
    const add = (a, b) => {
      for (const [latitude, longitude] of [a, b]) {
        const point = new THREE.Vector3(Math.cos(latitude) * Math.sin(longitude), Math.sin(latitude),
          Math.cos(latitude) * Math.cos(longitude));
        ring.push(...this.world.worldToLocal(point).toArray());
      }
    };
    const degree = Math.PI / 180;
    for (let latitude = -60; latitude <= 60; latitude += 30) {
      for (let k = 0; k < 72; ++k) add([latitude * degree, 5 * k * degree], [latitude * degree, 5 * (k + 1) * degree]);
    }
    for (let longitude = 0; longitude < 360; longitude += 30) {
      for (let k = -18; k < 18; ++k) add([5 * k * degree, longitude * degree], [5 * (k + 1) * degree, longitude * degree]);
    }
    this.layer('sphere', 'sphere of directions', 'line', this.lines(ring));
  }

  // One line per kind of motion, a dot per frame. Lines are dashed where the scale is not measured.
  addPath() {
    const names = ['path', 'rotating', 'still'];
    const labels = [hasPositions ? 'camera path' : 'where the camera looks', 'rotating', 'at rest'];
    const at = (k) => Array.from(this.path.slice(3 * k, 3 * k + 3));
    for (let kind = 0; kind < 3; ++kind) {
      const solid = [], loose = [], dots = [];
      for (let k = 0; k < numFrames; ++k) {
        if (kindOf[k] !== kind) continue;
        const segment = data.segments[segmentOf[k]];
        const isLoose = segment && segment.scale === 'continuity';
        if (!isLoose || k % 6 < 3) dots.push(...at(k));
        if (k + 1 < numFrames) (isLoose ? loose : solid).push(...at(k), ...at(k + 1));
      }
      if (dots.length === 0) continue;
      const group = new THREE.Group();
      group.add(this.lines(solid));
      if (loose.length > 0) {
        const size = 0.006 * this.pathSize;
        const dashed = new THREE.LineSegments(this.geometry(loose),
          new THREE.LineDashedMaterial({dashSize: size, gapSize: size}));
        dashed.computeLineDistances();
        group.add(dashed);
      }
      const size = kind === 0 ? (numFrames > 1500 ? 2.5 : 4.5) : 12;
      const points = this.dots(dots, size);
      // Frames of a pure rotation lie at one point, which the path around it shall not hide.
      points.material.depthTest = kind === 0;
      points.renderOrder = kind;
      group.add(points);
      this.layer(names[kind], labels[kind], kSegmentColors[kind], group);
    }
  }

  addTruth() {
    const positions = [];
    for (let k = 0; k + 1 < truth.frame.length; ++k) {
      if (truth.frame[k + 1] - truth.frame[k] > 2 * data.frame_step) continue;
      positions.push(...truth.position.slice(3 * k, 3 * k + 6));
    }
    this.layer('truth', 'ground truth', 'truth', this.lines(positions));
  }

  frustum(place, size) {
    const tan = this.tangents();
    const rotation = this.rotationOf(place);
    const center = this.centerOf(place);
    return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) =>
      // On the sphere of directions the corners lie on it.
      new THREE.Vector3(x * tan[0], y * tan[1], 1).setLength(hasPositions ? Math.hypot(x * tan[0], y * tan[1], 1) : 1)
        .multiplyScalar(size).applyQuaternion(rotation).add(center));
  }

  tangents() {
    if (keyframes) return [keyframes.tan_x, keyframes.tan_y];
    const camera = summary.camera;
    return [0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy];
  }

  frustumLines(place, size) {
    const corners = this.frustum(place, size);
    const center = this.centerOf(place);
    const list = [];
    corners.forEach((corner, k) => list.push(center, corner, corner, corners[(k + 1) % 4]));
    return list.flatMap((point) => point.toArray());
  }

  addFrusta() {
    const places = hasPositions && keyframes ? Array.from(keyframes.frame, placeOf) : [];
    const few = Math.max(1, Math.ceil(numFrames / 60));
    if (!hasPositions) for (let k = 0; k < numFrames; k += few) places.push(k);
    if (places.length === 0) return;
    this.frustumSize = hasPositions ?
      Math.min(0.05 * this.pathSize, Math.max(0.8 * keyframes.frustum_size, 0.012 * this.pathSize)) : 0.95;
    const positions = places.flatMap((place) => this.frustumLines(place, this.frustumSize));
    this.layer('frusta', hasPositions ? 'keyframes' : everyNth(few, 'view'), 'green', this.lines(positions, 0.55),
      hasPositions);
  }

  addLoops() {
    const positions = [];
    for (const loop of data.loops.accepted) {
      for (const frame of [loop.frame, loop.match]) positions.push(...this.centerOf(placeOf(frame)).toArray());
    }
    if (positions.length > 0) this.layer('loops', 'loops', 'violet', this.lines(positions, 0.7));
  }

  addMarker() {
    const group = new THREE.Group();
    this.markerLines = this.lines(new Array(48).fill(0));
    this.markerDot = this.dots([0, 0, 0], 12);
    this.markerDot.material.depthTest = false;
    for (const object of [this.markerLines, this.markerDot]) {
      object.frustumCulled = false;
      object.renderOrder = 4;
      group.add(object);
    }
    this.layer('marker', 'camera now', 'red', group);
  }

  setFrame(place) {
    const size = hasPositions ? Math.max(2.2 * (this.frustumSize || 0), 0.055 * this.pathSize) : 1;
    this.markerLines.geometry.attributes.position.array.set(this.frustumLines(place, size));
    this.markerLines.geometry.attributes.position.needsUpdate = true;
    const dot = hasPositions ? this.centerOf(place) : new THREE.Vector3().fromArray(this.path, 3 * place);
    this.markerDot.geometry.attributes.position.array.set(dot.toArray());
    this.markerDot.geometry.attributes.position.needsUpdate = true;
    this.drawSoon();
  }

  markerPosition() {
    return Array.from(this.markerDot.geometry.attributes.position.array);
  }

  startRenderer() {
    this.renderer = new THREE.WebGLRenderer({antialias: true, alpha: true});
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.box.append(this.renderer.domElement);
    this.camera = new THREE.PerspectiveCamera(45, 1, 0.002 * this.radius, 200 * this.radius);
    this.controls = new THREE.OrbitControls(this.camera, this.renderer.domElement);
    this.controls.screenSpacePanning = true;
    this.controls.addEventListener('change', () => this.drawSoon());
    new ResizeObserver(() => this.resize()).observe(this.box);
    this.resize();
  }

  resize() {
    const width = Math.max(1, this.box.clientWidth), height = Math.max(1, this.box.clientHeight);
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    if (!this.touched) this.look();
    // The new size has emptied the canvas.
    this.draw();
  }

  // From behind the cameras and above, just far enough to see all that shall be shown.
  look(fromAbove = false) {
    const forward = new THREE.Vector3();
    for (let k = 0; k < numFrames; ++k) {
      forward.add(new THREE.Vector3(0, 0, 1).applyQuaternion(this.rotationOf(k)).transformDirection(this.world.matrixWorld));
    }
    forward.y = 0;
    if (forward.length() < 0.1 * numFrames) forward.set(0.6, 0, -1);
    forward.normalize();
    const elevation = fromAbove ? 1.5 : hasPositions ? 0.62 : 0.35;
    const away = forward.multiplyScalar(-Math.cos(elevation)).add(new THREE.Vector3(0, Math.sin(elevation), 0)).normalize();
    const right = new THREE.Vector3(0, 1, 0).cross(away).normalize();
    const above = away.clone().cross(right);
    const tangent = Math.tan(0.5 * this.camera.fov * Math.PI / 180) * 0.92;
    let distance = 0;
    const offset = new THREE.Vector3();
    // The path keeps clear of what lies over the view: buttons above, the legend below.
    const clear = Math.max(0.5, 1 - 110 / this.box.clientHeight);
    this.shown.forEach((point, k) => {
      offset.copy(point).sub(this.middle);
      const depth = offset.dot(away);
      distance = Math.max(distance, depth + Math.abs(offset.dot(right)) / (tangent * this.camera.aspect),
        depth + Math.abs(offset.dot(above)) / (k < this.numPathPoints ? clear * tangent : tangent));
    });
    this.controls.target.copy(this.middle);
    this.camera.position.copy(this.middle).addScaledVector(away, distance);
    this.controls.update();
    this.drawSoon();
  }

  setColors() {
    for (const {colorName, object} of Object.values(this.layers)) {
      object.traverse((part) => {
        // Points have their own colours; on a light page even white ones must be seen.
        if (part.material) part.material.color.set(color(part.material.vertexColors ? 'cloud' : colorName));
      });
    }
    this.drawSoon();
  }

  show(name, shown) {
    this.layers[name].object.visible = shown;
    this.drawSoon();
  }

  drawSoon() {
    if (this.waiting || !this.renderer) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    this.renderer.render(this.scene, this.camera);
  }

  // The picture at this moment, whatever the browser has kept of it.
  snapshot() {
    this.draw();
    return this.renderer.domElement.toDataURL();
  }
}
