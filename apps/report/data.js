// What the page is about: the run's data, decoded.

const data = JSON.parse(document.getElementById('data').textContent);
const summary = data.summary;

const frames = decodeAll(data.frames);
const numFrames = frames.frame.length;
const cloud = data.cloud ? decodeAll(data.cloud) : null;
const keyframes = data.keyframes ? decodeAll(data.keyframes) : null;
const graph = decodeAll(data.graph);
const truth = data.truth ? decodeAll(data.truth) : null;
const hasPositions = frames.position !== undefined;

// Where a frame of the run stands among those shown.
function placeOf(frame) {
  return Math.max(0, Math.min(numFrames - 1, Math.round(frame / data.frame_step)));
}

const kindOf = new Uint8Array(numFrames);
const segmentOf = new Int32Array(numFrames).fill(-1);
data.segments.forEach((segment, index) => {
  for (let k = 0; k < numFrames; ++k) {
    if (frames.frame[k] < segment.first || frames.frame[k] > segment.last) continue;
    kindOf[k] = kKinds[segment.kind] || 0;
    segmentOf[k] = index;
  }
});

const kFlagNames = ['interpolated: matches no other frame', 'weak edge', 'orientation given', 'searched wide',
  'break: matches no earlier frame', 'loop'];

// The one frame that slider, view, charts and picture show; whoever shows it listens.
const listeners = [];
let current = 0;
function setFrame(place) {
  current = Math.max(0, Math.min(numFrames - 1, Math.round(place)));
  for (const listener of listeners) listener(current);
}
