// Advice on texts that keep the rover from driving, and the line on low packs.

// The first that fits a text of the rover.
const ADVICE = [
  [/PARAM_CHECKED/, 'Settings were lost: look through Set up first.'],
  [/not neutral/, 'Let go of the stick.'],
  [/MOT_DRV_VOLT/, 'It may burn the motor drivers: unplug it.'],
  [/has failed|own report/, 'Do not use this pack.'],
  [/cells|contradicts/, 'Check chemistry and cells under Set up.'],
  [/over temperature/, 'Let the pack cool down.'],
  [/>=/, 'Under Set up, critical has to be below low.'],
  [/no pin|no capacity|in use|not set up|over range|GP29/, 'Check pins, capacity and kind of sensor under Set up.'],
  [/unhealthy|missing|not connected/, 'Check the plug and the wires of the pack.'],
  [/low|critical|empty|below/, 'Charge the pack, or plug in a full one.'],
  [/limits the motors/, 'It drives slower, to spare the pack. Push the stick less.'],
  [/^Radio/, 'No stick was received for too long, so it stopped. Go nearer, then choose Manual.'],
  [/^GCS/, 'No ground station was heard for too long, so it stopped. Go nearer, then choose Manual.'],
  [/^Terminated/, 'The pack is too low. Charge it, then restart the rover.'],
  [/Logging/, 'Set LOG_BITMASK 0 to drive without a log.'],
];

function advised(text) {
  const [, advice] = ADVICE.find(([pattern]) => pattern.test(text)) || [];
  return advice ? text + '. ' + advice : text;
}

// Levels of a pack, as texts name them and by number of the charge state.
const LEVELS = { low: 2, critical: 3, emergency: 4, missing: 6, unhealthy: 6 };
const isLevel = (state) => state > 1 && state < 7;
const UNHEALTHY = 6;

// A text that belongs to a pack's own notice: the pack, whether a failsafe acts, and the level.
const levelText = (text) => /^Battery (\d) (is )?(low|critical|emergency|missing|unhealthy)/.exec(text);

on('text', ({ text }) => {
  const [, limiting, isOver] = /^Battery (\d) (no longer )?limits/.exec(text) || [];
  if (packs.has(limiting - 1)) packs.get(limiting - 1).limit = !isOver && { text, at: now() };
  const [, number, isFailsafe, word] = levelText(text) || [];
  const pack = packs.get(number - 1);
  if (!pack) return;
  const level = LEVELS[word];
  if (level < UNHEALTHY) {
    alarm();
    if (isFailsafe) pack.failsafe = level;
  }
  if (isFailsafe || pack.failsafe != level) pack.causes[level] = text;
});

// A level that was left, also by a reset, has no notice any more.
on('pack', (pack) => {
  const { state, alarmed } = pack;
  if (!isLevel(state)) Object.assign(pack, { causes: {}, failsafe: 0, alarmed: 0 });
  else if (state < UNHEALTHY && !(alarmed >= state)) {
    pack.alarmed = state;
    alarm();
  }
});

on('state', () => armed || packs.forEach((pack) => (pack.limit = 0)));

// What is low or fails of a pack, and what it means for the driver.
function levelNotice({ name, prefix, state, volts, percent, causes, failsafe }) {
  const reading = () => joined([CHARGE_STATES[state][0].toLowerCase(), volts && digits(volts, 2) + ' V', percent != null && percent + ' %']);
  const text = causes[state] || causes[failsafe] || name + ': ' + reading();
  if (state > 4 || /already/.test(text)) return advised(text);
  const levels = levelsOf(prefix);
  const isObeyed = failsafe && value(prefix + 'FS_' + (failsafe == 2 ? 'LOW' : 'CRT') + '_ACT');
  if (isObeyed) return text + '. The rover stops to spare the pack: charge it.';
  return text + (levels && mode != HOLD && !stopsWhenLow(levels) ? '. Nothing stops the rover: drive home, and charge the pack.' : '. Charge the pack.');
}

// Obstacles to driving in the rover's own words, with advice.
function notices() {
  const found = [];
  if (lacksKey()) found.push('The rover has a signing key: enter it under Link.');
  if (ignored && age() > FRESH_MS) found.push('Nothing comes that is signed with your key: it is wrong, or the rover has none.');
  if (!isFresh()) return found;
  if (status == STATE_TERMINATED) found.push(advised(textLike(/^Terminated/) || 'Terminated'));
  if (status == STATE_TIMED_OUT) found.push(advised(textLike(/Failsafe: Hold$/) || 'Failsafe: Hold'));
  if (armed) {
    const reported = allPacks().filter(({ state }) => isLevel(state));
    found.push(...reported.sort((one, other) => other.state - one.state).map(levelNotice));
    // To a new connection the rover says it again, if it still limits.
    const limits = allPacks().map(({ limit }) => limit).filter((limit) => limit && (limit.at > openedAt || now() - openedAt < GREETING_MS));
    found.push(...limits.map(({ text }) => advised(text)));
  }
  if (ready == false && !armed) found.push(...(obstacles[0] ? obstacles : ['not ready']).map((text) => 'Does not arm: ' + advised(text)));
  return found;
}

function renderNotices() {
  const found = notices();
  for (const list of document.querySelectorAll('.notices')) {
    fill(list, found.map((text) => el('li', {}, text, /PARAM_CHECKED/.test(text) ? el('button', { onclick: () => setParameter('PARAM_CHECKED', 1) }, 'Set') : '')));
  }
}

// Of both levels, low and critical: what the rover does then, as far as a threshold leads to it. Undefined until all is known.
function levelsOf(prefix) {
  let isUnknown;
  const of = (name) => {
    isUnknown ||= value(prefix + name) == null;
    return value(prefix + name);
  };
  const seconds = of('LOW_TIMER');
  const byPercent = of('FS_PCT_EN');
  const levels = ['LOW', 'CRT'].map((level) => {
    const volts = of(level + '_VOLT');
    const mah = of(level + '_MAH');
    const action = of('FS_' + level + '_ACT');
    const percent = Math.max(of(level + '_PCT'), level == 'CRT' && of('EMR_PCT'));
    const bounds = joined([seconds && volts && digits(volts, 2) + ' V for ' + seconds + ' s', mah && mah + ' mAh', byPercent && percent && percent + ' %'], ' or ');
    return bounds && { action, text: 'Below ' + bounds + (!action ? ' it only warns' : action == TERMINATE ? ' it disarms' : ' it stops in Hold') };
  });
  return isUnknown ? undefined : levels.filter((level) => level);
}

const stopsWhenLow = (levels) => levels.some(({ action }) => action);

// One line on the rover's reaction to a low pack.
function whenLow(prefix = parameterOf('')) {
  const levels = levelsOf(prefix);
  return levels ? levels.map(({ text }) => text + '. ').join('') + (stopsWhenLow(levels) ? '' : 'A low pack does not stop the rover.') : '';
}
