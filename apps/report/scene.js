// The map in three dimensions. Without positions: the directions that the camera has looked in, on a sphere.

class Scene extends MapView {
  constructor(box) {
    super(box);
    this.rotations = Array.from({length: numFrames}, (_, place) => this.rotationOf(place));
    this.turnUpright(this.rotations);
    this.path = hasPositions ? frames.position : this.viewingDirections();
    const hasCloud = hasPositions && cloud !== null;
    this.frameBounds(this.path, hasCloud ? cloud.position : null, hasCloud ? cloud.position.length / 3 : 0, !hasPositions);
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

  viewingDirections() {
    const path = new Float32Array(3 * numFrames);
    for (let k = 0; k < numFrames; ++k) {
      new THREE.Vector3(0, 0, 1).applyQuaternion(this.rotationOf(k)).toArray(path, 3 * k);
    }
    return path;
  }

  addAll() {
    if (cloud && hasPositions) this.layer('cloud', 'cloud', 'muted', this.coloredPoints(cloud.position, cloud.rgb));
    if (!hasPositions) this.addSphere();
    this.addPath();
    if (hasPositions && truth && truth.position) this.addTruth();
    this.addFrusta();
    if (hasPositions) this.addLoops();
    this.addMarker();
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

  tangents() {
    if (keyframes) return [keyframes.tan_x, keyframes.tan_y];
    const camera = summary.camera;
    return [0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy];
  }

  addFrusta() {
    const places = hasPositions && keyframes ? Array.from(keyframes.frame, placeOf) : [];
    const few = Math.max(1, Math.ceil(numFrames / 60));
    if (!hasPositions) for (let k = 0; k < numFrames; k += few) places.push(k);
    if (places.length === 0) return;
    this.frustumSize = hasPositions ?
      Math.min(0.05 * this.pathSize, Math.max(0.8 * keyframes.frustum_size, 0.012 * this.pathSize)) : 0.95;
    const positions = places.flatMap((place) => this.frustumOf(place, this.frustumSize));
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

  frustumOf(place, size) {
    return this.frustumLines(this.rotationOf(place), this.centerOf(place), this.tangents(), size, !hasPositions);
  }

  setFrame(place) {
    const size = hasPositions ? Math.max(2.2 * (this.frustumSize || 0), 0.055 * this.pathSize) : 1;
    const dot = hasPositions ? this.centerOf(place) : new THREE.Vector3().fromArray(this.path, 3 * place);
    this.setMarker(this.frustumOf(place, size), dot);
  }

  // From behind the cameras and above.
  look(fromAbove = false) {
    this.placeCamera(this.meanForward(this.rotations), fromAbove ? 1.5 : hasPositions ? 0.62 : 0.35);
  }
}
