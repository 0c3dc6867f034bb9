// The room of the logs: by HTTP, or by signed MAVLink where the rover has a key.

const LOG_MS = 1500;

// As the rover names it by HTTP.
function nameOf({ number, time_utc }) {
  const day = time_utc && new Date(time_utc * SECOND).toISOString().slice(0, 10);
  return joined(['rover', boardId(), day, ('' + number).padStart(8, 0)], '-') + '.BIN';
}

const LIST_DIRECTORY = 3;
const FTP_ACK = 128;

// Numbers of the logs by FTP, the oldest first: MAVLink's own list counts places.
async function readNumbers() {
  const numbers = [];
  for (;;) {
    const { length } = numbers;
    // Sequence, session, operation and size, then the first entry wanted; the path is "LOGS".
    ask('FILE_TRANSFER_PROTOCOL', { payload: [length, 0, 0, LIST_DIRECTORY, 4, 0, 0, 0, length & 255, length >> 8, 0, 0, 76, 79, 71, 83] });
    const answer = await next('FILE_TRANSFER_PROTOCOL', ({ payload }) => payload[0] == ((length + 1) & 255), LOG_MS);
    if (!answer) throw NO_ANSWER;
    const { payload } = answer;
    if (payload[3] != FTP_ACK) return numbers;
    const names = String.fromCharCode(...payload.slice(12, 12 + payload[4]));
    numbers.push(...names.match(/\d+(?=\.)/g).map(Number));
  }
}

// By HTTP nothing can be signed.
async function readList() {
  if (!signer) {
    const answer = await fetch('/logs/', { cache: 'no-store' });
    if (answer.ok) return answer.json();
    throw await answer.text();
  }
  // The board's id is part of a log's name.
  version || (await next('AUTOPILOT_VERSION', undefined, LOG_MS));
  const numbers = await readNumbers();
  const entries = new Map();
  ask('LOG_REQUEST_LIST', { end: 65535 });
  for (;;) {
    const entry = await next('LOG_ENTRY', undefined, LOG_MS);
    if (!entry) throw NO_ANSWER;
    const { id, size, time_utc, num_logs } = entry;
    if (num_logs != numbers.length) throw REFUSED;
    const number = numbers[id - 1];
    if (num_logs) entries.set(id, { id, number, bytes: size, time_utc });
    if (entries.size == num_logs) return [...entries.values()];
  }
}

// The whole file, from its begin to its end; what follows something lost is asked for again.
async function readLog({ id, bytes: size }, progress) {
  const bytes = new Uint8Array(size);
  let end = 0;
  let tries = 5;
  const isIt = (part) => part.id == id;
  const take = (part) => {
    if (!isIt(part) || part.ofs != end) return;
    const data = part.data.slice(0, Math.min(part.count, size - end));
    bytes.set(data, end);
    end += data.length;
    // Without data the log is gone.
    tries = data.length ? 5 : -1;
    progress(end / size);
  };
  on('LOG_DATA', take);
  while (end < size && tries-- > 0) {
    ask('LOG_REQUEST_DATA', { id, ofs: end, count: size - end });
    while (end < size && tries >= 0 && (await next('LOG_DATA', isIt, LOG_MS)));
  }
  off('LOG_DATA', take);
  ask('LOG_REQUEST_END');
  return end < size ? null : bytes;
}

async function listLogs() {
  let logs = [];
  put('logs-state', 'Reading the list…');
  try {
    logs = await readList();
    put('logs-state', logs[0] ? '' : 'No logs: recorded from arming on.');
  } catch (error) {
    put('logs-state', 'No list: ' + error);
  }
  $('log-list').replaceChildren(...logs.reverse().map(rowOf));
  hide('erase', !logs[0]);
}

function rowOf(log) {
  const { number, bytes, time_utc, name } = log;
  const label = { ariaLabel: 'Download log ' + number };
  const get = signer
    ? el('button', { ...label, onclick: () => save(log, get) }, 'Download')
    : el('a', { ...label, className: 'button', href: '/logs/' + number + '.BIN', download: name }, 'Download');
  const date = time_utc ? new Date(time_utc * SECOND).toLocaleString() : 'no date';
  return el('li', {}, el('b', {}, 'Log ' + number + ', ' + digits(bytes / 1e3) + ' kB', el('br'), el('small', {}, date)), get);
}

async function save(log, button) {
  button.disabled = true;
  const bytes = await readLog(log, (share) => show(button, digits(share * 100) + ' %'));
  button.disabled = false;
  show(button, 'Download');
  if (bytes) el('a', { href: URL.createObjectURL(new Blob([bytes])), download: nameOf(log) }).click();
  else put('logs-state', 'Broken off');
}

function startLogs() {
  $('read-logs').onclick = listLogs;
  askTwice($('erase'), 'Press again to erase all for good', async () => {
    const [before] = texts;
    if (isKnown()) ask('LOG_ERASE');
    put('logs-state', 'Erasing…');
    await after(LOG_MS);
    await listLogs();
    $('erase').hidden || put('logs-state', inItsWords('Not erased', before));
  });
}
