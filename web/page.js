// Small helpers around the document.

const $ = (id) => document.getElementById(id);

function el(tag, properties, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

function show(element, text) {
  if (element.textContent != text) element.textContent = text;
}

// A list is left alone while it reads the same: what is selected in it stays selected.
function fill(list, items) {
  if (list.textContent != items.map((item) => item.textContent).join('')) list.replaceChildren(...items);
}

// By id.
const put = (id, text) => show($(id), text);
const hide = (id, isHidden) => ($(id).hidden = isHidden);

// Vibrates and beeps, as a driver looks at the rover. Browsers allow both once the page was touched.
let sound;
let alarmedAt = -Infinity;

function alarm() {
  if (!sound || now() - alarmedAt < SECOND) return;
  alarmedAt = now();
  navigator.vibrate?.([300, 100, 300]);
  const beep = sound.createOscillator();
  beep.connect(sound.destination);
  beep.start();
  beep.stop(sound.currentTime + .5);
}

onpointerup = () => (sound ||= new AudioContext()).resume();

// What there is of these, in one text.
const joined = (parts, by = ', ') => parts.filter((part) => part).join(by);

// For screen readers.
const say = (text) => put('say', text);

const digits = (number, places = 0) => number.toFixed(places).replace(/^-(?=[0.]+$)/, '').replace('-', '−');

function duration(seconds) {
  const minutes = Math.round(seconds / 60);
  if (seconds < 90) return digits(seconds) + ' s';
  return minutes < 60 ? minutes + ' min' : Math.floor(minutes / 60) + ' h ' + (minutes % 60) + ' min';
}

const clock = (date) => date.toTimeString().slice(0, 8);

// As typed anywhere: 0,125 is clear and so is 2200,5, but 2,200 may be two numbers.
function numberIn({ value }) {
  const text = value.trim().replace('−', '-');
  return !text || (/,\d{3}$/.test(text) && !/^-?0,/.test(text)) ? NaN : +text.replace(',', '.');
}

const MISREAD = 'Not a clear number';

// A button that acts when it is pressed a second time before it loses the focus, where that is needed.
function askTwice(button, question, act, isNeeded = () => 1) {
  const label = button.textContent;
  const reset = () => {
    button.className = '';
    show(button, label);
  };
  button.onblur = reset;
  button.onclick = () => {
    if (button.className || !isNeeded()) {
      reset();
      act();
    } else {
      button.className = 'sure';
      show(button, question);
    }
  };
}
