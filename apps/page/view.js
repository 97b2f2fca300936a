// What every view in three dimensions has: layers that are switched on and off, a camera that shows all, colours of
// the scheme. A world without positions is a sphere of radius one, on which the camera's directions lie.

class MapView {
  constructor(box) {
    this.box = box;
    this.scene = new THREE.Scene();
    this.world = new THREE.Group();
    this.scene.add(this.world);
    this.layers = {};
    this.shown = [];
    this.middle = new THREE.Vector3();
  }

  // A list of rotations. Against the mean of the cameras' downward axes; a camera upright at its start where they cancel.
  turnUpright(rotations) {
    const sum = new THREE.Vector3();
    for (const rotation of rotations) sum.add(new THREE.Vector3(0, -1, 0).applyQuaternion(rotation));
    const up = sum.length() > 0.2 * rotations.length ? sum.normalize() : new THREE.Vector3(0, -1, 0);
    this.world.quaternion.setFromUnitVectors(up, new THREE.Vector3(0, 1, 0));
    this.world.updateMatrixWorld(true);
  }

  // What the view shall hold: the whole path, and the cloud without its far points. Rows of three numbers; of the cloud
  // the first `numPoints`.
  frameBounds(path, cloudPositions, numPoints, isSphere) {
    const points = [];
    const add = (x, y, z) => points.push(this.world.localToWorld(new THREE.Vector3(x, y, z)));
    const step = Math.max(1, Math.floor(path.length / 1500));
    for (let k = 0; 3 * k + 2 < path.length; k += step) add(path[3 * k], path[3 * k + 1], path[3 * k + 2]);
    if (isSphere) for (const s of [-1, 1]) points.push(new THREE.Vector3(s, s, s));
    this.numPathPoints = points.length;
    const pathBox = new THREE.Box3().setFromPoints(points);
    if (numPoints > 0) {
      const sample = [];
      const every = 3 * Math.max(1, Math.floor(numPoints / 3000));
      for (let k = 0; k + 2 < 3 * numPoints; k += every) {
        sample.push(this.world.localToWorld(new THREE.Vector3().fromArray(cloudPositions, k)));
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
    this.pathSize = Math.max(1e-6, pathBox.getSize(new THREE.Vector3()).length());
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

  coloredPoints(positions, rgb) {
    const geometry = this.geometry(positions);
    geometry.setAttribute('color', new THREE.BufferAttribute(rgb, 3, true));
    return new THREE.Points(geometry,
      new THREE.PointsMaterial({size: 1.6, sizeAttenuation: false, vertexColors: THREE.VertexColors}));
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
    return this.layer('sphere', 'sphere of directions', 'line', this.lines(ring));
  }

  // The pyramid of a camera's view as pairs of ends. `tangents` are those of half its angles; on the sphere of directions
  // the corners lie on the sphere.
  frustumLines(rotation, center, tangents, size, onSphere = false) {
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) => {
      const corner = new THREE.Vector3(x * tangents[0], y * tangents[1], 1);
      if (onSphere) corner.normalize();
      return corner.multiplyScalar(size).applyQuaternion(rotation).add(center);
    });
    const list = [];
    corners.forEach((corner, k) => list.push(center, corner, corner, corners[(k + 1) % 4]));
    return list.flatMap((point) => point.toArray());
  }

  // The camera at one time: its pyramid and a dot that nothing hides.
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

  setMarker(lines, dot) {
    this.markerLines.geometry.attributes.position.array.set(lines);
    this.markerLines.geometry.attributes.position.needsUpdate = true;
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
    this.lookAgain();
    // The new size has emptied the canvas.
    this.draw();
  }

  // In a new size.
  lookAgain() { this.look(); }

  // Where the camera stands to look along `forward`, a direction in the upright world, from `elevation` above: just far
  // enough to see all that shall be shown.
  cameraPlace(forward, elevation) {
    const away = forward.clone().multiplyScalar(-Math.cos(elevation)).add(new THREE.Vector3(0, Math.sin(elevation), 0))
      .normalize();
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
    return this.middle.clone().addScaledVector(away, distance);
  }

  placeCamera(forward, elevation) {
    this.controls.target.copy(this.middle);
    this.camera.position.copy(this.cameraPlace(forward, elevation));
    this.controls.update();
    this.drawSoon();
  }

  // Mean viewing direction of a list of rotations, level in the upright world; `otherwise` where they cancel.
  meanForward(rotations, otherwise = new THREE.Vector3(0.6, 0, -1)) {
    const forward = new THREE.Vector3();
    for (const rotation of rotations) {
      forward.add(new THREE.Vector3(0, 0, 1).applyQuaternion(rotation).transformDirection(this.world.matrixWorld));
    }
    forward.y = 0;
    if (forward.length() < 0.1 * rotations.length) forward.copy(otherwise);
    return forward.normalize();
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

// The legend, a box for each layer, and the buttons. Returns what sets their colours.
function addViewTools(view) {
  const legend = $('legend'), tools = $('view-tools');
  const marks = [];
  for (const [name, {label, colorName, shown}] of Object.entries(view.layers)) {
    const mark = h('i', {});
    const tags = view.layers[name].tags = [h('span', {}, mark, label)];
    if (name === 'cloud') mark.className = 'colourful';
    else marks.push([mark, colorName]);
    legend.append(tags[0]);
    if (name === 'marker') continue;
    const box = h('input', {type: 'checkbox'});
    box.checked = shown;
    box.addEventListener('change', () => view.show(name, box.checked));
    tags.push(h('label', {}, box, label));
    tools.append(tags[1]);
  }
  for (const [text, above] of [['top', true], ['reset', false]]) {
    const button = h('button', {}, text);
    button.addEventListener('click', () => view.look(above));
    tools.append(button);
  }
  return () => {
    view.setColors();
    for (const [mark, colorName] of marks) mark.style.background = color(colorName);
  };
}
