// The growing map. As long as there are no positions: the directions that the camera has looked in, on a sphere.

// Pyramids of keyframes drawn at most.
const kMaxFrusta = 300;

class LiveScene extends MapView {
  constructor(box) {
    super(box);
    this.isSphere = true;
    this.followsAll = true;
    this.elevation = null;
    this.hidden = new Set();
    this.sphere = this.addSphere();
    this.layer('cloud', 'cloud', 'muted', this.coloredPoints([], new Uint8Array(0)));
    this.frusta = this.layer('frusta', 'keyframes', 'green', this.lines([], 0.55));
    this.loops = this.layer('loops', 'before the last loop', 'violet', this.lines([], 0.7));
    this.pathLines = [], this.pathDots = [];
    ['path', 'rotating', 'still'].forEach((name, kind) => {
      const group = new THREE.Group();
      this.pathLines.push(this.lines([]));
      this.pathDots.push(this.dots([], kind === 0 ? 4 : 12));
      // Frames of a pure rotation lie at one point, which the path around it shall not hide.
      this.pathDots[kind].material.depthTest = kind === 0;
      this.pathDots[kind].renderOrder = kind;
      group.add(this.pathLines[kind], this.pathDots[kind]);
      this.layer(name, ['camera path', 'rotating', 'at rest'][kind], kSegmentColors[kind], group);
    });
    this.addMarker();
    // They grow, and their bounds are not kept up to date.
    this.world.traverse((part) => { part.frustumCulled = false; });
    this.frameBounds([], null, 0, true);
    this.startRenderer();
    this.controls.addEventListener('start', () => { this.followsAll = false; });
    this.change();
  }

  // Shows the first `count` rows of positions, which may be a larger array.
  fill(object, positions, count = positions.length / 3) {
    const geometry = object.geometry;
    const attribute = geometry.attributes.position;
    if (attribute.array.length < 3 * count) {
      geometry.dispose();
      const larger = new Float32Array(Math.max(3 * count, 2 * attribute.array.length));
      geometry.setAttribute('position', new THREE.BufferAttribute(larger, 3));
    }
    geometry.attributes.position.array.set(positions.length > 3 * count ? positions.subarray(0, 3 * count) : positions);
    geometry.attributes.position.needsUpdate = true;
    geometry.setDrawRange(0, count);
  }

  fillCloud() {
    const geometry = this.layers.cloud.object.geometry;
    if (geometry.attributes.position.array !== cloud.position) {
      geometry.dispose();
      geometry.setAttribute('position', new THREE.BufferAttribute(cloud.position, 3));
      geometry.setAttribute('color', new THREE.BufferAttribute(cloud.rgb, 3, true));
    }
    geometry.attributes.position.needsUpdate = true;
    geometry.attributes.color.needsUpdate = true;
    geometry.setDrawRange(0, cloud.count);
  }

  rotation(quaternion) { return new THREE.Quaternion().fromArray(quaternion).normalize(); }

  direction(place) {
    return new THREE.Vector3(0, 0, 1).applyQuaternion(this.rotation(frames.quaternion[place])).toArray();
  }

  // Every so many of `count` places.
  some(count, most) {
    const step = Math.max(1, Math.ceil(count / most));
    return Array.from({length: Math.ceil(count / step)}, (_, k) => k * step);
  }

  // Takes in what is new of the map and of the frames.
  change(mapHasChanged = true) {
    const wasSphere = this.isSphere;
    this.isSphere = keyframes.count === 0;
    if (wasSphere !== this.isSphere || mapHasChanged) {
      const source = this.isSphere ? frames : keyframes;
      const rotations = this.some(source.quaternion.length, 300).map((k) => this.rotation(source.quaternion[k]));
      // The world does not tilt while somebody watches it grow.
      if (wasSphere !== this.isSphere || !this.isUpright) this.turnUpright(rotations);
      this.sphere.quaternion.copy(this.world.quaternion).conjugate();
      this.isUpright = rotations.length > 0;
      this.forward = this.meanForward(rotations, this.forward);
    }
    if (mapHasChanged) this.fillCloud();
    if (mapHasChanged || wasSphere !== this.isSphere) this.findBounds();
    if (mapHasChanged) this.fillFrusta();
    this.fillPath();
    this.setVisible();
    this.moveMarker();
    this.follow(wasSphere !== this.isSphere);
    this.drawSoon();
  }

  fillFrusta() {
    const lines = this.some(keyframes.count, kMaxFrusta).flatMap((k) => this.frustumLines(
      this.rotation(keyframes.quaternion[k]), this.center(keyframes, k), session.tangents, this.frustumSize()));
    this.fill(this.frusta, lines);
  }

  center(source, k) {
    return this.isSphere || !source.position[k] ? new THREE.Vector3() : new THREE.Vector3().fromArray(source.position[k]);
  }

  frustumSize() { return Math.max(0.02 * this.pathSize, 0.012 * this.radius); }

  // Lines and dots by kind of motion.
  fillPath() {
    const lines = [[], [], []], dots = [[], [], []];
    if (this.isSphere) {
      for (let k = 0; k < numFrames; ++k) {
        const kind = kKinds[frames.state[k]] || 0;
        dots[kind].push(...this.direction(k));
        if (k + 1 < numFrames) lines[kind].push(...this.direction(k), ...this.direction(k + 1));
      }
    } else {
      this.fillMapPath(lines, dots);
    }
    for (let kind = 0; kind < 3; ++kind) {
      this.fill(this.pathLines[kind], lines[kind]);
      this.fill(this.pathDots[kind], dots[kind]);
      this.pathDots[kind].material.size = (this.isSphere ? 3 : kind === 0 ? 4 : 12) * Math.min(2, window.devicePixelRatio || 1);
    }
    const before = session.pathBefore || [];
    this.fill(this.loops, before.slice(1).flatMap((position, k) => [...before[k], ...position]));
  }

  // Keyframes stand where the newest map has them; behind the newest one the frames stand where they were found.
  fillMapPath(lines, dots) {
    const kindOf = this.kindsOfKeyframes();
    for (let k = 0; k < keyframes.count; ++k) {
      dots[0].push(...keyframes.position[k]);
      if (k > 0) lines[kindOf[k]].push(...keyframes.position[k - 1], ...keyframes.position[k]);
    }
    for (const segment of data.segments) {
      const place = this.keyframeBefore(frames.frame[segment.last]);
      const position = place < 0 ? frames.position[segment.first] : keyframes.position[place];
      if (position) dots[kKinds[segment.kind]].push(...position);
    }
    const newest = keyframes.frame[keyframes.count - 1];
    let before = keyframes.position[keyframes.count - 1];
    for (let k = this.placeBehind(newest); k < numFrames; ++k) {
      const position = frames.position[k];
      if (!position) continue;
      lines[kKinds[frames.state[k]] || 0].push(...before, ...position);
      before = position;
    }
  }

  // Of the way to a keyframe from the one before: rotating only where the camera has kept its place all the way.
  kindsOfKeyframes() {
    const kinds = new Uint8Array(keyframes.count);
    for (const segment of data.segments) {
      for (let k = 1; k < keyframes.count; ++k) {
        if (keyframes.frame[k - 1] >= frames.frame[segment.first] && keyframes.frame[k] <= frames.frame[segment.last]) {
          kinds[k] = kKinds[segment.kind];
        }
      }
    }
    return kinds;
  }

  // The last keyframe that is not behind a frame.
  keyframeBefore(frame) {
    let low = -1, high = keyframes.count - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (keyframes.frame[middle] <= frame) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  // The first place whose frame is behind another.
  placeBehind(frame) {
    let place = numFrames;
    while (place > 0 && frames.frame[place - 1] > frame) --place;
    return place;
  }

  moveMarker() {
    if (numFrames === 0) return;
    const place = numFrames - 1;
    const center = this.center(frames, place);
    const size = this.isSphere ? 1 : 2.4 * this.frustumSize();
    const lines = this.frustumLines(this.rotation(frames.quaternion[place]), center, session.tangents, size, this.isSphere);
    this.setMarker(lines, this.isSphere ? new THREE.Vector3().fromArray(this.direction(place)) : center);
  }

  findBounds() {
    const path = this.isSphere ? [] : keyframes.position.flat();
    this.frameBounds(path, cloud.position, this.isSphere ? 0 : cloud.count, this.isSphere);
  }

  // All comes into view little by little while the map grows, until somebody takes hold of it.
  follow(atOnce) {
    this.camera.near = 0.002 * this.radius;
    this.camera.far = 400 * this.radius;
    this.camera.updateProjectionMatrix();
    if (!this.followsAll) return;
    const elevation = this.elevation !== null ? this.elevation : this.isSphere ? 0.35 : 0.62;
    const place = this.cameraPlace(this.forward, elevation);
    const share = atOnce ? 1 : 0.15;
    this.controls.target.lerp(this.middle, share);
    this.camera.position.lerp(place, share);
    this.controls.update();
  }

  look(fromAbove = false) {
    this.elevation = fromAbove ? 1.5 : null;
    this.followsAll = true;
    if (!this.forward) this.forward = this.meanForward([]);
    this.follow(true);
    this.drawSoon();
  }

  lookAgain() {
    if (this.followsAll) this.look(this.elevation !== null);
  }

  setVisible() {
    const has = (kind) => data.segments.some((segment) => kKinds[segment.kind] === kind);
    const exists = {cloud: !this.isSphere, frusta: !this.isSphere, sphere: this.isSphere, loops: !this.isSphere && session.pathBefore !== null,
      rotating: has(1), still: has(2), marker: numFrames > 0};
    for (const [name, {object, tags}] of Object.entries(this.layers)) {
      object.visible = exists[name] !== false && !this.hidden.has(name);
      // Its place in the legend and among the boxes.
      for (const tag of tags || []) tag.hidden = exists[name] === false;
    }
  }

  show(name, shown) {
    if (shown) this.hidden.delete(name);
    else this.hidden.add(name);
    this.setVisible();
    this.drawSoon();
  }
}
