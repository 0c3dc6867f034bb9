// The room of the driver. The stick is a dead man's handle: whatever takes the driver's hand or eyes away lets go of it.

const TICK_MS = 50;
const HOLD_TO_ARM_MS = 1000;
const FULL = 1000;
// A socket that has not drained for this many ticks keeps what is sent: it would arrive as old commands.
const FULL_TICKS = 4;
const GAMEPAD_DEAD_ZONE = 0.12;
const STOP_REPEAT_MS = 200;
const STOP_MS = 5000;

const KEYS = {
  ArrowUp: [0, 1], KeyW: [0, 1], ArrowDown: [0, -1], KeyS: [0, -1],
  ArrowLeft: [-1, 0], KeyA: [-1, 0], ArrowRight: [1, 0], KeyD: [1, 0],
};

const LOST = {
  closed: 'No connection: the rover stops by itself.',
  stale: 'Nothing is heard of the rover: it stops by itself.',
  full: 'The network takes nothing: the rover stops by itself.',
  hidden: 'The page is hidden.',
  blurred: 'The page has lost the focus: touch it.',
};

const stick = {
  // From -1 to 1: to the right, and ahead.
  x: 0,
  y: 0,
  // Whether this page drives: it has armed, chosen Manual or moved the stick, since the rover was disarmed.
  drives: false,
  lost: '',
  fullTicks: 0,
  pointer: null,
  keys: new Set(),
  gamepad: null,
  sent: 0,
};

// Why the stick must not be sent, or nothing.
function obstacle() {
  if (document.hidden) return 'hidden';
  if (!document.hasFocus()) return 'blurred';
  if (!link.isOpen) return 'closed';
  if (!link.isFresh) return 'stale';
  return stick.fullTicks >= FULL_TICKS ? 'full' : '';
}

function sendStick(x, y) {
  const scaled = (share) => Math.round(Math.max(-1, Math.min(1, share)) * FULL * $('limit').value / 100);
  stick.sent++;
  link.send('MANUAL_CONTROL', { target: link.rover.system, y: scaled(x), z: scaled(y) });
}

const sendNeutral = () => sendStick(0, 0);

function moveStick(x, y) {
  Object.assign(stick, { x, y });
  const far = $('pad').clientWidth / 2 - $('knob').offsetWidth / 2;
  $('knob').style.transform = `translate(${x * far}px,${-y * far}px)`;
  show($('sticks'), 'Throttle ' + digits(y * $('limit').value, 0) + ' %, steering ' + digits(x * $('limit').value, 0) + ' %');
}

// The stick springs back: neutral, at once. What held it has to let go before it holds it again.
function letGo() {
  const { pointer } = stick;
  stick.pointer = null;
  if (pointer != null && $('pad').hasPointerCapture(pointer)) $('pad').releasePointerCapture(pointer);
  stick.keys.clear();
  stick.gamepad = null;
  moveStick(0, 0);
  if (stick.drives) sendNeutral();
}

function takeStick(x, y) {
  if (stick.lost) return;
  stick.drives = true;
  moveStick(x, y);
}

function lose(why) {
  if (stick.lost == why) return;
  const was = stick.lost;
  stick.lost = why;
  if (why && !was) letGo();
}

function tick() {
  const isFull = stick.drives && link.isOpen && !link.isDrained;
  stick.fullTicks = isFull ? stick.fullTicks + 1 : 0;
  lose(obstacle());
  readGamepad();
  if (stick.lost || !stick.drives || !rover.armed || isFull) return;
  sendStick(stick.x, stick.y);
}

function readGamepad() {
  const pads = navigator.getGamepads ? [...navigator.getGamepads()] : [];
  const pad = pads.find((pad) => pad && pad.connected);
  if (!pad) {
    if (stick.gamepad) letGo();
    return;
  }
  if (pad.buttons[1]?.pressed) return stop();
  const live = (share) => (Math.abs(share) < GAMEPAD_DEAD_ZONE ? 0 : share);
  const [x, y] = [live(pad.axes[0]), -live(pad.axes[1])];
  if (!x && !y) {
    if (stick.gamepad == 'moved') moveStick(0, 0);
    stick.gamepad = 'neutral';
  } else if (stick.gamepad && stick.pointer == null) {
    stick.gamepad = 'moved';
    takeStick(x, y);
  }
}

function startPad() {
  const pad = $('pad');
  const follow = ({ clientX, clientY }) => {
    const box = pad.getBoundingClientRect();
    const far = box.width / 2 - $('knob').offsetWidth / 2;
    let x = (clientX - box.left - box.width / 2) / far;
    let y = (box.top + box.height / 2 - clientY) / far;
    const length = Math.hypot(x, y);
    if (length > 1) [x, y] = [x / length, y / length];
    takeStick(x, y);
  };
  pad.onpointerdown = (event) => {
    event.preventDefault();
    if (stick.pointer != null || event.button) return;
    pad.focus({ preventScroll: true });
    lose(obstacle());
    if (stick.lost) return;
    stick.pointer = event.pointerId;
    pad.setPointerCapture(event.pointerId);
    follow(event);
  };
  pad.onpointermove = (event) => event.pointerId == stick.pointer && follow(event);
  pad.onpointerup = pad.onpointercancel = pad.onlostpointercapture = (event) => event.pointerId == stick.pointer && letGo();
  pad.oncontextmenu = (event) => event.preventDefault();
  // Browsers without touch-action scroll and zoom otherwise.
  pad.addEventListener('touchmove', (event) => event.preventDefault(), { passive: false });
}

const takesText = ({ target }) => /INPUT|SELECT|TEXTAREA/.test(target.tagName);

function startKeys() {
  const follow = () => {
    let [x, y] = [0, 0];
    for (const key of stick.keys) [x, y] = [x + KEYS[key][0], y + KEYS[key][1]];
    takeStick(x, y);
  };
  addEventListener('keydown', (event) => {
    if (event.key == 'Escape') return stop();
    if (!KEYS[event.code] || $('drive').hidden || takesText(event) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    if (event.repeat || stick.lost) return;
    stick.keys.add(event.code);
    follow();
  });
  addEventListener('keyup', (event) => {
    if (!stick.keys.delete(event.code)) return;
    if (stick.keys.size) follow();
    else letGo();
  });
}

// Neutral and Hold, until the rover says that it stands.
let stopping = 0;
function stop() {
  const wasDriving = stick.drives;
  stick.drives = true;
  letGo();
  stick.drives = wasDriving;
  link.ask('COMMAND_LONG', { command: SET_MODE, param1: 1, param2: HOLD });
  command(REQUEST_MESSAGE, MESSAGES.HEARTBEAT.id, 0, 1);
  if (!stopping) stopping = performance.now();
  repeatStop();
}

let stopTimer = 0;
function repeatStop() {
  clearTimeout(stopTimer);
  stopTimer = setTimeout(() => {
    if (!stopping) return;
    if (performance.now() - stopping > STOP_MS) {
      stopping = 0;
      show($('stop-state'), 'No answer: the rover stops by itself');
      say('Stop: no answer');
      return;
    }
    link.ask('COMMAND_LONG', { command: SET_MODE, param1: 1, param2: HOLD });
    repeatStop();
  }, STOP_REPEAT_MS);
  show($('stop-state'), 'Stopping…');
}

function stopped() {
  clearTimeout(stopTimer);
  stopping = 0;
  show($('stop-state'), '');
  say('Stopped: Hold');
}

on('COMMAND_ACK', ({ command, result }) => {
  if (stopping && command == SET_MODE && result == ACCEPTED) stopped();
});

function startStop() {
  // At the touch, not at its end; a click without one is a keyboard's or a screen reader's.
  $('stop').onpointerdown = (event) => {
    event.preventDefault();
    stop();
  };
  $('stop').onclick = (event) => event.detail || stop();
}

function startArming() {
  const button = $('arm');
  let timer = 0;
  const begin = () => {
    if (timer || rover.armed) return;
    button.classList.add('held');
    timer = setTimeout(arm, HOLD_TO_ARM_MS);
  };
  const cancel = () => {
    if (timer && button.classList.contains('held') && !rover.armed) show($('drive-answer'), 'To arm, hold the button for one second.');
    clearTimeout(timer);
    timer = 0;
    button.classList.remove('held');
  };
  const arm = async () => {
    button.classList.remove('held');
    stick.drives = true;
    sendNeutral();
    show($('drive-answer'), 'Arming…');
    const result = await commandState(ARM, 1, 0, 1);
    const why = rover.texts.find(({ text }) => /^Arm: /.test(text));
    show($('drive-answer'), result == ACCEPTED ? '' : 'Not armed: ' + (result != null && why ? why.text : because(result)));
  };
  button.onpointerdown = (event) => event.button || begin();
  button.onpointerup = button.onpointerleave = button.onpointercancel = button.onblur = cancel;
  button.oncontextmenu = (event) => event.preventDefault();
  button.onkeydown = (event) => {
    if (event.key != ' ' && event.key != 'Enter') return;
    event.preventDefault();
    if (!event.repeat) begin();
  };
  button.onkeyup = cancel;
  $('disarm').onclick = async () => {
    if (stick.drives) letGo();
    const result = await commandState(ARM, 0);
    show($('drive-answer'), result == ACCEPTED ? '' : 'Not disarmed: ' + because(result));
  };
}

function startModes() {
  for (const [id, mode] of [['manual', MANUAL], ['hold', HOLD]]) {
    $(id).onclick = async () => {
      if (mode == MANUAL) stick.drives = true;
      if (stick.drives) letGo();
      const result = await setMode(mode);
      const [latest] = rover.texts;
      show($('drive-answer'), result == ACCEPTED ? '' : 'Not changed: ' + (result != null && latest ? latest.text : because(result)));
    };
  }
}

function driveHint() {
  if (stick.lost) return LOST[stick.lost];
  if (!rover.armed) return 'To drive: arm, then choose Manual.';
  return rover.mode == MANUAL ? 'The rover follows the stick.' : 'Armed, in Hold: it stands. Choose Manual to drive.';
}

function renderDrive() {
  const isLive = rover.armed != null && link.isFresh;
  $('arm').disabled = !isLive;
  $('arm').hidden = !!rover.armed;
  $('disarm').hidden = !rover.armed;
  for (const [id, mode] of [['manual', MANUAL], ['hold', HOLD]]) {
    $(id).ariaPressed = String(rover.mode == mode);
    $(id).disabled = !isLive;
  }
  show($('hint'), driveHint());
  $('pad').classList.toggle('live', isLive && !!rover.armed && rover.mode == MANUAL && !stick.lost);
  show($('limit-value'), $('limit').value + ' %');
  const [pack] = [...rover.packs.values()].filter((pack) => pack.at);
  const parts = pack ? [pack.percent == null ? '' : pack.percent + ' %', pack.volts == null ? '' : digits(pack.volts, 2) + ' V', pack.amps == null ? '' : digits(pack.amps, 1) + ' A'] : [];
  show($('drive-pack'), parts.filter((part) => part).join('  '));
}

on('state', () => {
  if (!rover.armed) stick.drives = false;
});

function startDrive() {
  startPad();
  startKeys();
  startStop();
  startArming();
  startModes();
  const look = () => lose(obstacle());
  addEventListener('blur', look);
  addEventListener('pagehide', () => lose('hidden'));
  addEventListener('focus', look);
  document.addEventListener('visibilitychange', look);
  on('closed', look);
  setInterval(tick, TICK_MS);
}
