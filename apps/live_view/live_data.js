// What the page is about: the session as the program tells it. Messages say what has changed; the first one of a
// connection says all, and what was there before is forgotten.

const kStates = ['starting', 'tracking', 'rotating', 'still', 'extrapolated'];
// All of so many newest frames are kept, and older ones as far apart as the program says once there are so many.
const kNumNewest = 600, kMaxFrames = 5200;

// One entry for each frame kept.
const frames = {frame: [], time_s: [], quaternion: [], position: [], state: [], flags: [],
  angle_deg: [[], [], []], sigma_deg: [[], [], []]};
let numFrames = 0;
const data = {segments: []};  // rotating and at rest, by place
const keyframes = {count: 0, frame: [], quaternion: [], position: []};
const cloud = {count: 0, position: new Float32Array(0), rgb: new Uint8Array(0)};
const session = {stats: {}, tangents: [0.6, 0.45], revision: 0, corrections: 0, correctionTimes: [], image: null,
  isFinished: false, numMessages: 0, pathBefore: null};

function placeOf(place) { return place; }

// The frame whose values the curves show: the newest, or one that was clicked on.
const listeners = [];
let current = 0;
let pinnedFrame = null;
function setFrame(place) {
  pinnedFrame = place < numFrames - 1 ? frames.frame[Math.max(0, place)] : null;
  showCurrent();
}
function showCurrent() {
  current = Math.max(0, numFrames - 1);
  if (pinnedFrame !== null) {
    const place = frames.frame.findIndex((frame) => frame >= pinnedFrame);
    if (place >= 0) current = place;
  }
  for (const listener of listeners) listener(current);
}

const kFrameColumns = [frames.frame, frames.time_s, frames.quaternion, frames.position, frames.state, frames.flags,
  ...frames.angle_deg, ...frames.sigma_deg];

function forgetAll() {
  for (const values of kFrameColumns) values.length = 0;
  numFrames = 0;
  data.segments = [];
  for (const values of [keyframes.frame, keyframes.quaternion, keyframes.position]) values.length = 0;
  keyframes.count = cloud.count = 0;
  Object.assign(session, {revision: 0, corrections: 0, correctionTimes: [], image: null, pathBefore: null});
}

function addSamples(message) {
  const part = decodeAll(message);
  for (let k = 0; k < part.frame.length; ++k) {
    const state = kStates[part.state[k]];
    frames.frame.push(part.frame[k]);
    frames.time_s.push(part.time_s[k]);
    frames.quaternion.push(Array.from(part.quaternion.subarray(4 * k, 4 * k + 4)));
    frames.position.push(part.has_position[k] ? Array.from(part.position.subarray(3 * k, 3 * k + 3)) : null);
    frames.state.push(state);
    frames.flags.push(state === 'extrapolated' ? kPredicted : 0);
    for (let axis = 0; axis < 3; ++axis) {
      frames.angle_deg[axis].push(part.angle_deg[3 * k + axis]);
      frames.sigma_deg[axis].push(part.sigma_deg[3 * k + axis]);
    }
  }
  numFrames = frames.frame.length;
  if (numFrames > kMaxFrames) thinFrames(message.stride);
  findSegments();
}

function thinFrames(stride) {
  const newest = frames.frame[numFrames - 1];
  const kept = frames.frame.map((frame) => frame % stride === 0 || frame > newest - kNumNewest);
  for (const values of kFrameColumns) {
    let count = 0;
    for (let k = 0; k < numFrames; ++k) if (kept[k]) values[count++] = values[k];
    values.length = count;
  }
  numFrames = frames.frame.length;
}

function findSegments() {
  data.segments = [];
  for (let k = 0; k < numFrames; ++k) {
    const kind = frames.state[k];
    if (!kKinds[kind]) continue;
    const last = data.segments[data.segments.length - 1];
    if (last && last.kind === kind && last.last === k - 1) last.last = k;
    else data.segments.push({first: k, last: k, kind});
  }
}

// An array of at least so many numbers that begins like `array`.
function grown(array, length) {
  if (array.length >= length) return array;
  const larger = new array.constructor(Math.max(length, 2 * array.length));
  larger.set(array);
  return larger;
}

function changeMap(message) {
  // What the path was before a loop moved it.
  if (message.corrections > session.corrections && session.revision > 0) {
    session.pathBefore = keyframes.position.slice(0, keyframes.count);
  }
  session.revision = message.revision;
  session.corrections = message.corrections;
  session.correctionTimes = Array.from(decode(message.correction_times_s));
  const points = decodeAll(message.points);
  cloud.position = grown(cloud.position, 3 * points.count);
  cloud.rgb = grown(cloud.rgb, 3 * points.count);
  cloud.count = points.count;
  for (let k = 0; 3 * k < points.position.length; ++k) {
    const row = points.row ? points.row[k] : k;
    for (let axis = 0; axis < 3; ++axis) {
      cloud.position[3 * row + axis] = points.position[3 * k + axis];
      cloud.rgb[3 * row + axis] = points.rgb[3 * k + axis];
    }
  }
  const part = decodeAll(message.keyframes);
  for (let k = 0; k < part.frame.length; ++k) {
    const row = part.row ? part.row[k] : k;
    keyframes.frame[row] = part.frame[k];
    keyframes.quaternion[row] = Array.from(part.quaternion.subarray(4 * k, 4 * k + 4));
    keyframes.position[row] = Array.from(part.position.subarray(3 * k, 3 * k + 3));
  }
  keyframes.count = part.count;
  for (const values of [keyframes.frame, keyframes.quaternion, keyframes.position]) values.length = part.count;
}

// What a message has changed: {frames, map, image}.
function takeMessage(message) {
  if (message.whole) {
    forgetAll();
    session.tangents = [message.camera.tan_x, message.camera.tan_y];
  }
  session.stats = message.stats;
  session.isFinished = message.finished;
  ++session.numMessages;
  if (message.samples) addSamples(message.samples);
  if (message.map) changeMap(message.map);
  if (message.image) session.image = message.image;
  return {frames: Boolean(message.samples) || Boolean(message.whole), map: Boolean(message.map) || Boolean(message.whole),
    image: Boolean(message.image)};
}
