// The room of the driver. The stick is a dead man's handle: whatever takes the driver's hand or eyes away lets go of it.

const TICK_MS = 50;
const FULL = 10;
// A socket that has not drained for this many ticks keeps what is sent: it would arrive as old commands.
const FULL_TICKS = 4;
const SLOW_MS = 1500;
const DEAD_ZONE = 0.12;
// The rover repeats every 5 s why a stick has no effect.
const TEXT_MS = 6000;

const STOP_OFTEN_MS = 5000;
const STOP_MS = 200;
const STOP_LOST_MS = 60000;
const ANSWER_MS = 3000;

// From -1 to 1: to the right, and ahead.
let stickX = 0;
let stickY = 0;
// Whether this page drives: it has armed, chosen Manual or moved the stick since the rover was disarmed.
let drives = false;
// Why the stick was taken from the driver, and whether the rover followed it until then.
let taken = '';
let wasFollowed;
// Whether the hand was at the centre since the rover drives by the stick, or was told to: until then it does not follow.
let wasCentred;
let fullTicks = 0;
// What holds the stick: a pointer by its number, keys, or a game pad by its index.
let holder = null;
const keys = new Set();
// Game pads that were neutral since the stick was let go.
const centred = new Set();
let stopsByPad;
// Since when Arm is pressed, if it is.
let armPressedAt;
// The rover's latest text on sticks without effect.
let blocked = {};
// The rover's latest text.
let said = '';

function obstacle() {
  if (!isFresh()) return 'The rover is not heard.';
  if (lacksKey()) return NO_KEY;
  if (!isIdentified || (isUnsigned() && allowed() == null)) return 'Asking which rover it is.';
  if (delay() > SLOW_MS) return 'The link is too slow to drive.';
  if (fullTicks >= FULL_TICKS) return 'The network takes nothing.';
  return document.hidden || !document.hasFocus() ? 'Touch the page: it has lost the focus.' : '';
}

function sendStick() {
  const scaled = (share) => Math.round(share * FULL * $('limit').value);
  ask('MANUAL_CONTROL', { target: roverSystem, y: scaled(stickX), z: scaled(stickY) });
}

function moveStick(x, y) {
  stickX = x;
  stickY = y;
  $('knob').style.transform = `translate(${stickX * 100}%,${-stickY * 100}%)`;
  const shown = (share) => digits(share * $('limit').value) + ' %';
  put('sticks', 'Throttle ' + shown(stickY) + ', steering ' + shown(stickX));
}

function pressArm(at) {
  armPressedAt = at;
  $('arm').className = at ? 'held' : '';
}

// The stick springs back: neutral, at once. What held it has to let go before it holds it again.
function letGo() {
  holder = null;
  keys.clear();
  centred.clear();
  pressArm();
  if (/^C/.test(blocked.text)) blocked = {};
  moveStick(0, 0);
  if (drives) sendStick();
}

function takeStick(by, x, y) {
  if (taken || (holder ?? by) != by) return;
  holder = by;
  drives = true;
  moveStick(x, y);
}

const isBlocked = () => now() - blocked.at < TEXT_MS;
const isDeflected = () => stickX || stickY;

function lookAtHand() {
  const isToDrive = wish.isObeyed && !wish.isStop && !wish.done && !wish.why;
  wasCentred = ((armed && mode == MANUAL) || isToDrive) && (wasCentred || !isDeflected());
}

// Looks whether the driver still has the stick.
function look() {
  const was = taken;
  taken = obstacle();
  if (!taken || was) return;
  wasFollowed = drives && wasCentred && !isBlocked();
  letGo();
}

function tick() {
  keepLink();
  fullTicks = socket.bufferedAmount ? fullTicks + 1 : 0;
  look();
  readGamepads();
  if ($('arm').disabled) pressArm();
  if (now() - armPressedAt >= SECOND) want(ARMED);
  repeatStop();
  lookAtHand();
  if (!taken && drives && armed && !fullTicks) sendStick();
}

function readGamepads() {
  const pads = [...(navigator.getGamepads?.() || [])].filter((pad) => pad?.connected);
  const stopped = stopsByPad;
  stopsByPad = pads.some(({ buttons }) => buttons[1]?.pressed);
  if (stopsByPad && !stopped) stop();
  if (/pad/.test(holder) && !pads.some(({ index }) => 'pad' + index == holder)) letGo();
  if ($('drive').hidden) return;
  for (const { index, axes } of pads) {
    const by = 'pad' + index;
    const [x, y] = axes.map((share) => (Math.abs(share) < DEAD_ZONE ? 0 : share));
    if (!x && !y) {
      if (holder == by) letGo();
      centred.add(by);
    } else if (centred.has(by)) takeStick(by, x, -y);
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
    takeStick(event.pointerId, x / length, y / length);
  };
  pad.onpointerdown = (event) => {
    event.preventDefault();
    pad.focus({ preventScroll: true });
    look();
    if (taken || holder != null || event.button) return;
    pad.setPointerCapture(event.pointerId);
    box = pad.getBoundingClientRect();
    follow(event);
  };
  const held = (act) => (event) => event.pointerId === holder && act(event);
  pad.onpointermove = held(follow);
  pad.onpointerup = pad.onpointercancel = pad.onlostpointercapture = held(letGo);
}

function startKeys() {
  const has = (pattern) => pattern.test([...keys]);
  const letGoOfKeys = () => keys.size && letGo();
  const follow = () => takeStick('keys', has(/Right|KeyD/) - has(/Left|KeyA/), has(/Up|KeyW/) - has(/Down|KeyS/));
  onkeydown = (event) => {
    const { code, target, repeat } = event;
    if (code == 'Escape' && !repeat) stop();
    const isModified = event.ctrlKey || event.metaKey || event.altKey;
    // macOS does not report keys that are released under a modifier.
    if (isModified) letGo();
    if (isModified || !/^(Arrow|Key[WASD])/.test(code) || $('drive').hidden || /INPUT|SELECT/.test(target.tagName)) return;
    event.preventDefault();
    if (repeat || taken) return;
    keys.add(code);
    follow();
  };
  onkeyup = ({ code }) => {
    if (!keys.delete(code)) return;
    if (keys.size) follow();
    else letGo();
  };
  // Nor those that are released in a menu.
  oncontextmenu = (event) => {
    if ($('drive').hidden) return;
    event.preventDefault();
    letGoOfKeys();
  };
  document.onmouseleave = letGoOfKeys;
}

// What the driver may want of the rover: a command, whether the rover has obeyed, and how to say that it has not.
const STOP = { command: SET_MODE, param2: HOLD, isStop: true, isObeyed: () => mode == HOLD || !armed, failure: 'Not stopped: ' };
const ARMED = { command: ARM, isObeyed: () => armed, failure: 'Not armed: ' };
const DRIVEN = { command: SET_MODE, param2: MANUAL, isObeyed: () => mode == MANUAL, failure: 'Not in Manual: ' };

// The latest one, which takes back the one before. Until the ping that goes before it is answered, all that is heard is older.
let wish = {};

const isStopWanted = () => wish.isStop && !wish.done;
const waited = () => now() - wish.at;

function begin(what) {
  // To arm, or a mode by its own number.
  const at = Math.floor(now());
  wish = { param1: 1, at, since: at, before: texts[0], ...what };
  letGo();
  lookAtHand();
  sendWish();
  renderDrive();
}

function sendWish() {
  wish.sentAt = now();
  wish.why = lacksKey() && NO_KEY;
  ping();
  ask('COMMAND_LONG', wish);
  request('HEARTBEAT');
}

// Arm or Manual, sent once: a later try could undo a Stop.
function want(what) {
  look();
  if (taken) return;
  drives = true;
  // Read once.
  hide('screen', true);
  begin(what);
}

// Sent again until the rover has obeyed, also by another connection.
function stop() {
  stops++;
  // However often it is touched, the first touch counts for how long it takes.
  begin(isStopWanted() ? { ...STOP, at: wish.at } : STOP);
}

function repeatStop() {
  if (!isStopWanted()) return;
  wish.lost ||= now() - Math.max(heardAt, wish.since) > STOP_LOST_MS;
  const isLate = waited() >= STOP_OFTEN_MS;
  if (isLate && wish.alarmed != wish.lost) {
    wish.alarmed = wish.lost;
    alarm();
  }
  const interval = isLate ? SECOND : STOP_MS;
  if (!wish.why && !wish.lost && now() - wish.sentAt >= interval) sendWish();
}

// A refusal may end with another key or connection.
on('opened', () => isStopWanted() && !wish.lost && sendWish());

on('COMMAND_ACK', ({ command, result }) => {
  if (command != wish.command || wish.done || answeredAt < wish.at) return;
  wish.answered = true;
  wish.why = inItsWords(result && REFUSED, wish.before);
});

on('state', lookAtHand);
on('state', () => {
  if (answeredAt < wish.at) return;
  drives &&= armed;
  const { done, answered, isStop, isObeyed } = wish;
  wish.done = isObeyed?.() && (answered || !isStop);
  if (done && !wish.done) wish = {};
});

on('text', ({ text }) => {
  // Its greeting is no answer; thresholds, levels of packs and sticks have lines of their own.
  if (!/^(Set BATT|Battery failsafes|rover-|Sticks|Centre)/.test(text) && !levelText(text)) said = text;
  if (/^(Sticks|Centre)/.test(text)) blocked = { text, at: now() };
});

function wishText() {
  const { isStop, done, lost, answered, why, failure } = wish;
  if (done) return isStop && mode == HOLD ? 'Stopped: Hold' : '';
  if (why) return failure + why;
  if (lost) return 'Stop is not confirmed: touch again.';
  if (isStop) return waited() < STOP_OFTEN_MS ? 'Stopping…' : 'No answer: it may drive on. Switch it off.';
  return waited() > ANSWER_MS && !answered ? failure + NO_ANSWER : '';
}

function startDrive() {
  // At the touch, not at its end; a click without one is a keyboard's or a screen reader's.
  $('stop').onpointerdown = (event) => {
    event.preventDefault();
    stop();
  };
  $('stop').onclick = (event) => event.detail || stop();
  $('hold').onclick = stop;
  $('manual').onclick = () => want(DRIVEN);
  $('disarm').onclick = async () => {
    letGo();
    if (!isStopWanted()) wish = {};
    const why = await command(ARM, 0);
    request('HEARTBEAT');
    said = why && 'Not disarmed: ' + why;
  };
  const arm = $('arm');
  const press = () => taken || pressArm(now());
  const cancel = () => pressArm();
  // Focused by a pointer, it would take the keys of the stick.
  const limit = $('limit');
  limit.onclick = limit.onchange = () => limit.matches(':focus-visible') || limit.blur();
  arm.onpointerdown = (event) => {
    // A touch is captured by what it began on, and would never leave it.
    arm.releasePointerCapture(event.pointerId);
    if (!event.button) press();
  };
  arm.onpointerup = arm.onpointerleave = arm.onpointercancel = arm.onblur = arm.onkeyup = cancel;
  arm.onkeydown = (event) => {
    if (!/Space|Enter/.test(event.code)) return;
    event.preventDefault();
    if (!event.repeat) press();
  };
  moveStick(0, 0);
  startPad();
  startKeys();
  onblur = () => {
    look();
    if (!taken) letGo();
  };
  onfocus = document.onvisibilitychange = look;
  onpagehide = letGo;
  on('closed', look);
  setInterval(tick, TICK_MS);
}

function renderDrive() {
  const fresh = isFresh();
  const isManual = fresh && mode == MANUAL;
  const isReady = isManual && armed && wasCentred && !taken && !isBlocked();
  let hint = 'To drive, arm and choose Manual.';
  if (taken) hint = taken + (wasFollowed && !(isStopWanted() && waited() > STOP_OFTEN_MS) ? ' The rover stops by itself.' : '');
  else if (armed && !isManual) hint = 'In Hold it stands: choose Manual to drive.';
  else if (armed && isBlocked()) hint = blocked.text;
  else if (armed && isDeflected()) hint = wasCentred ? 'The rover follows the stick.' : 'Let go of the stick first.';
  else if (armed) hint = 'Move the stick to drive.';
  const answer = wishText();
  put('hint', !taken && !armed && notices()[0] ? '' : hint);
  put('stop-state', wish.isStop ? answer : '');
  put('drive-answer', (!wish.isStop && answer) || said);
  $('hold').ariaPressed = fresh && mode == HOLD;
  $('manual').ariaPressed = isManual;
  $('manual').disabled = !isKnown();
  $('arm').disabled = !isKnown() || armed;
  $('disarm').disabled = fresh && !armed;
  $('pad').className = isReady ? 'follows' : '';
  put('limit-value', $('limit').value + ' %');
  const line = whenLow();
  put('when-low', line && !(armed && notices()[0]) ? line + ' → Set up' : '');
}
