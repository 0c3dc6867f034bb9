// Small helpers around the document.

const $ = (id) => document.getElementById(id);

function el(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

function show(element, text) {
  if (element.textContent != text) element.textContent = text;
}

// For screen readers.
const say = (text) => show($('say'), text);

const digits = (number, places) => number.toFixed(places).replace('-', '−');

function duration(seconds) {
  const minutes = Math.round(seconds / 60);
  if (seconds < 90) return Math.round(seconds) + ' s';
  return minutes < 60 ? minutes + ' min' : Math.floor(minutes / 60) + ' h ' + (minutes % 60) + ' min';
}

const clock = (date) => date.toTimeString().slice(0, 8);

// A button that acts when it is pressed a second time, within five seconds.
function askTwice(button, question, act) {
  const label = button.textContent;
  let asked = 0;
  button.onclick = () => {
    clearTimeout(asked);
    if (button.classList.toggle('sure')) {
      show(button, question);
      asked = setTimeout(reset, 5000);
    } else {
      show(button, label);
      act();
    }
  };
  const reset = () => {
    button.classList.remove('sure');
    show(button, label);
  };
  button.onblur = () => {
    clearTimeout(asked);
    reset();
  };
}
