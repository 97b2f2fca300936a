// Small helpers that all scripts of our pages share.

const kArrayTypes = {f32: Float32Array, i32: Int32Array, u16: Uint16Array, u8: Uint8Array};

function decode(array) {
  const text = atob(array.data);
  const bytes = new Uint8Array(text.length);
  for (let k = 0; k < text.length; ++k) bytes[k] = text.charCodeAt(k);
  return new kArrayTypes[array.type](bytes.buffer);
}

// Every array of an object, under its name.
function decodeAll(object) {
  const decoded = {};
  for (const [name, value] of Object.entries(object || {})) {
    decoded[name] = value && value.data !== undefined ? decode(value) : value;
  }
  return decoded;
}

// One column of a row-major array.
function column(values, columns, index) {
  const result = new Float32Array(values.length / columns);
  for (let k = 0; k < result.length; ++k) result[k] = values[k * columns + index];
  return result;
}

// Kinds of motion, and the colours of the path by them: translating, rotating, still.
const kKinds = {rotating: 1, still: 2};
const kSegmentColors = ['blue', 'orange', 'violet'];

// Bits of a frame's flags.
const kPredicted = 1, kWeak = 2, kBreak = 16, kLoop = 32;

const $ = (id) => document.getElementById(id);

function h(tag, attributes, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes || {})) {
    if (name === 'class') element.className = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

// Asking the browser for a colour makes it lay out the page anew, so they are kept until the scheme changes.
const colors = new Map();
function color(name) {
  if (!colors.has(name)) colors.set(name, getComputedStyle(document.documentElement).getPropertyValue('--' + name).trim());
  return colors.get(name);
}

// `value` with so many significant digits, without an exponent where that can be read.
function significant(value, digits) {
  if (value === null || value === undefined) return '–';
  if (!Number.isFinite(value)) return String(value);
  if (value !== 0 && (Math.abs(value) < 1e-4 || Math.abs(value) >= 1e7)) return value.toExponential(digits - 1);
  return String(Number(value.toPrecision(digits)));
}

// With so many decimals; what rounds to nothing has no sign.
function fixed(value, decimals) {
  return value === null || value === undefined ? '–' : value.toFixed(decimals).replace(/^-(?=[0.]*$)/, '');
}

function whole(value) {
  return value === null || value === undefined ? '–' : value.toLocaleString('en-GB');
}

function counted(value, noun) { return whole(value) + ' ' + noun + (value === 1 ? '' : 's'); }

function everyNth(step, noun) {
  if (step === 1) return 'every ' + noun;
  const isTeen = Math.floor(step % 100 / 10) === 1;
  return `every ${step}${(!isTeen && {1: 'st', 2: 'nd', 3: 'rd'}[step % 10]) || 'th'} ${noun}`;
}

function panel(parent, title, ...children) {
  const section = h('section', {class: 'panel'}, h('h2', {}, title), ...children);
  parent.append(section);
  return section;
}

function table(rows, header) {
  const element = h('table', {});
  const cells = (row, tag) => h('tr', {}, ...row.map((cell) => {
    const numeric = typeof cell === 'number' || (cell && cell.number !== undefined);
    const text = cell && cell.number !== undefined ? cell.number : cell;
    return h(tag, numeric ? {class: 'number'} : {}, text instanceof Node ? text : String(text));
  }));
  if (header) element.append(cells(header, 'th'));
  for (const row of rows) element.append(cells(row, 'td'));
  return element;
}

const number = (text) => ({number: text});
