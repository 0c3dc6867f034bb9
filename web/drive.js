// The room of the driver. The stick is a dead man's handle: whatever takes the driver's hand or eyes away lets go of it.

const TICK_MS = 50;
const FULL = 10;
// A socket that has not drained for this many ticks keeps what is sent: it would arrive as old commands.
const FULL_TICKS = 4;
const DEAD_ZONE = 0.12;
const STOP_TRIES = 25;

const BY_ITSELF = ' The rover stops by itself.';
const TAKEN = {
  blurred: 'Touch the page: it has lost the focus.',
  stale: 'The rover is not heard.' + BY_ITSELF,
  full: 'The network takes nothing.' + BY_ITSELF,
};

// From -1 to 1: to the right, and ahead.
let stickX = 0;
let stickY = 0;
// Whether this page drives: it has armed, chosen Manual or moved the stick since the rover was disarmed.
let drives = false;
// What took the stick from the driver.
let taken = '';
let fullTicks = 0;
// What holds the stick: a finger, keys, a game pad that was neutral before.
let pointer = null;
const keys = new Set();
let gamepad = 0;

function obstacle() {
  if (document.hidden) return 'hidden';
  if (!document.hasFocus()) return 'blurred';
  if (!isFresh()) return 'stale';
  return fullTicks < FULL_TICKS ? '' : 'full';
}

function sendStick() {
  const scaled = (share) => Math.round(share * FULL * $('limit').value);
  send('MANUAL_CONTROL', { target: roverSystem, y: scaled(stickX), z: scaled(stickY) });
}

function moveStick(x, y) {
  stickX = Math.max(-1, Math.min(1, x));
  stickY = Math.max(-1, Math.min(1, y));
  $('knob').style.transform = `translate(${stickX * 100}%,${-stickY * 100}%)`;
  const shown = (share) => digits(share * $('limit').value) + ' %';
  put('sticks', 'Throttle ' + shown(stickY) + ', steering ' + shown(stickX));
}

// The stick springs back: neutral, at once. What held it has to let go before it holds it again.
function letGo() {
  pointer = null;
  keys.clear();
  gamepad = 0;
  moveStick(0, 0);
  if (drives) sendStick();
}

function takeStick(x, y) {
  drives = true;
  moveStick(x, y);
}

// Looks whether the driver still has the stick.
function look() {
  const was = taken;
  taken = obstacle();
  if (taken && !was) letGo();
}

function tick() {
  const isFull = drives && isOpen() && socket.bufferedAmount > 0;
  fullTicks = isFull ? fullTicks + 1 : 0;
  look();
  readGamepad();
  if (!taken && drives && armed && !isFull) sendStick();
}

function readGamepad() {
  const pad = [...(navigator.getGamepads?.() || [])].find((pad) => pad?.connected);
  if (!pad) {
    if (gamepad > 1) letGo();
    return;
  }
  if (pad.buttons[1]?.pressed) stop();
  const [x, y] = pad.axes.map((share) => (Math.abs(share) < DEAD_ZONE ? 0 : share));
  if (!x && !y) {
    if (gamepad > 1) letGo();
    gamepad = 1;
  } else if (gamepad && !taken && pointer == null) {
    gamepad = 2;
    takeStick(x, -y);
  }
}

function startPad() {
  const pad = $('pad');
  // Where the pad was when it was touched: if it moves meanwhile, the stick does not.
  let box;
  const follow = (event) => {
    // The knob's way is a third of the pad.
    const half = box.width / 2;
    const x = (event.clientX - box.left - half) / half * 1.5;
    const y = (box.top + half - event.clientY) / half * 1.5;
    const length = Math.max(1, Math.hypot(x, y));
    takeStick(x / length, y / length);
  };
  pad.onpointerdown = (event) => {
    event.preventDefault();
    pad.focus({ preventScroll: true });
    look();
    if (taken || pointer != null || event.button) return;
    pointer = event.pointerId;
    pad.setPointerCapture(pointer);
    box = pad.getBoundingClientRect();
    follow(event);
  };
  const held = (act) => (event) => event.pointerId == pointer && act(event);
  pad.onpointermove = held(follow);
  pad.onpointerup = pad.onpointercancel = pad.onlostpointercapture = held(letGo);
  // Browsers without touch-action scroll and zoom otherwise.
  pad.ontouchmove = pad.oncontextmenu = (event) => event.preventDefault();
}

function startKeys() {
  const has = (arrow, letter) => keys.has('Arrow' + arrow) || keys.has('Key' + letter);
  const follow = () => takeStick(has('Right', 'D') - has('Left', 'A'), has('Up', 'W') - has('Down', 'S'));
  onkeydown = (event) => {
    const { code, target } = event;
    if (event.key == 'Escape') stop();
    if (!/^(Arrow|Key[WASD])/.test(code) || $('drive').hidden || /INPUT|SELECT/.test(target.tagName) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (event.repeat || taken) return;
    keys.add(code);
    follow();
  };
  onkeyup = ({ code }) => {
    if (!keys.delete(code)) return;
    if (keys.size) follow();
    else letGo();
  };
}

// Neutral and Hold, until the rover has confirmed it.
let stopTries = 0;
function stop() {
  const drove = drives;
  drives = true;
  letGo();
  drives = drove;
  if (!stopTries) setTimeout(repeatStop);
  stopTries = STOP_TRIES;
  put('stop-state', 'Stopping…');
}

function repeatStop() {
  if (!stopTries) return;
  ask('COMMAND_LONG', { command: SET_MODE, param1: 1, param2: HOLD });
  ask('COMMAND_LONG', { command: REQUEST_MESSAGE, param1: MESSAGES['HEARTBEAT'].id });
  stopTries--;
  if (stopTries) setTimeout(repeatStop, 200);
  else put('stop-state', 'No answer.' + BY_ITSELF);
}

function startArming() {
  const button = $('arm');
  let timer;
  const begin = () => {
    button.className = 'held';
    timer = setTimeout(arm, SECOND);
  };
  const cancel = () => {
    clearTimeout(timer);
    button.className = '';
  };
  const arm = async () => {
    cancel();
    letGo();
    drives = true;
    sendStick();
    const why = await changeState(ARM, 1, 0, 1);
    put('drive-answer', why && 'Not armed: ' + why);
  };
  button.onpointerdown = (event) => event.button || begin();
  button.onpointerup = button.onpointerleave = button.onpointercancel = button.onblur = button.onkeyup = cancel;
  button.oncontextmenu = (event) => event.preventDefault();
  button.onkeydown = (event) => {
    if (event.key != ' ' && event.key != 'Enter') return;
    event.preventDefault();
    if (!event.repeat) begin();
  };
}

function startDrive() {
  const changes = { disarm: [ARM, 0], hold: [SET_MODE, 1, HOLD], manual: [SET_MODE, 1, MANUAL] };
  for (const [id, change] of Object.entries(changes)) {
    $(id).onclick = async () => {
      drives ||= id == 'manual';
      letGo();
      put('drive-answer', await changeState(...change));
    };
  }
  // At the touch, not at its end; a click without one is a keyboard's or a screen reader's.
  $('stop').onpointerdown = (event) => {
    event.preventDefault();
    stop();
  };
  $('stop').onclick = (event) => event.detail || stop();
  moveStick(0, 0);
  startPad();
  startKeys();
  startArming();
  onblur = onfocus = document.onvisibilitychange = look;
  onpagehide = letGo;
  on('closed', look);
  setInterval(tick, TICK_MS);
}

on('state', () => {
  drives &&= armed;
  if (mode == HOLD && stopTries) put('stop-state', 'Stopped: Hold');
  if (mode == HOLD) stopTries = 0;
  else if (!stopTries) put('stop-state', '');
});

function renderDrive() {
  const isKnown = armed != null && isFresh();
  const follows = isKnown && armed && mode == MANUAL && !taken;
  const standing = armed ? 'In Hold it stands: choose Manual to drive.' : 'To drive, arm and choose Manual.';
  put('hint', TAKEN[taken] || (follows ? 'The rover follows the stick.' : standing));
  $('hold').ariaPressed = isKnown && mode == HOLD;
  $('manual').ariaPressed = isKnown && mode == MANUAL;
  $('manual').disabled = !isKnown;
  $('arm').disabled = !isKnown || armed;
  $('disarm').disabled = isKnown && !armed;
  $('pad').className = follows ? 'follows' : '';
  put('limit-value', $('limit').value + ' %');
}
