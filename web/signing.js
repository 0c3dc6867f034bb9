// MAVLink 2 signing. A page by http has no crypto.subtle, so SHA-256 is its own.

const SIGNING_EPOCH_MS = Date.UTC(2015, 0, 1);

const random = (count) => Math.floor(Math.random() * count);

// The times of each sender's link only grow: two pages must not share one.
const linkId = random(256);

// The first 32 bits of the fractional parts of a root of the first primes.
function rootsOfPrimes(count, root) {
  const words = [];
  for (let number = 2; words.length < count; number++) {
    let divisor = 2;
    while (number % divisor) divisor++;
    if (divisor == number) words.push(((number ** (1 / root) % 1) * 2 ** 32) | 0);
  }
  return words;
}

const SHA_START = rootsOfPrimes(8, 2);
const SHA_ROUNDS = rootsOfPrimes(64, 3);

function sha256(bytes) {
  const padded = new Uint8Array(((bytes.length + 8) >> 6 << 6) + 64);
  padded.set(bytes);
  padded[bytes.length] = 0x80;
  const view = new DataView(padded.buffer);
  view.setUint32(padded.length - 4, bytes.length * 8);
  const turn = (word, by) => (word >>> by) | (word << (32 - by));
  const hash = [...SHA_START];
  const words = [];
  for (let block = 0; block < padded.length; block += 64) {
    let [a, b, c, d, e, f, g, h] = hash;
    for (let round = 0; round < 64; round++) {
      if (round < 16) {
        words[round] = view.getInt32(block + round * 4);
      } else {
        const x = words[round - 15];
        const y = words[round - 2];
        const low = turn(x, 7) ^ turn(x, 18) ^ (x >>> 3);
        const high = turn(y, 17) ^ turn(y, 19) ^ (y >>> 10);
        words[round] = (words[round - 16] + low + words[round - 7] + high) | 0;
      }
      const choice = (e & f) ^ (~e & g);
      const one = h + (turn(e, 6) ^ turn(e, 11) ^ turn(e, 25)) + choice + SHA_ROUNDS[round] + words[round];
      const two = (turn(a, 2) ^ turn(a, 13) ^ turn(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
      [a, b, c, d, e, f, g, h] = [(one + two) | 0, a, b, c, (d + one) | 0, e, f, g];
    }
    [a, b, c, d, e, f, g, h].forEach((word, index) => (hash[index] = (hash[index] + word) | 0));
  }
  const result = new DataView(new ArrayBuffer(32));
  hash.forEach((word, index) => result.setInt32(index * 4, word));
  return new Uint8Array(result.buffer);
}

// The key of a passphrase is its SHA-256, as in MAVProxy.
const keyOf = (passphrase) => sha256(new TextEncoder().encode(passphrase));

// Signs frames with a key, and recognises frames that were, each once: the times of each stream only grow. Ours follow them.
function newSigner(key) {
  let time = 0;
  const latest = {};
  const signatureOf = (bytes) => sha256(Uint8Array.from([...key, ...bytes])).slice(0, 6);
  return {
    sign(frame) {
      time = Math.max(time + 1, (Date.now() - SIGNING_EPOCH_MS) * 100);
      const signed = [...frame, linkId];
      for (let byte = 0; byte < 6; byte++) signed.push(Math.floor(time / 256 ** byte) % 256);
      return [...signed, ...signatureOf(signed)];
    },

    accepts({ bytes, isSigned, system, component }) {
      const end = bytes.length - 6;
      const stamp = bytes.slice(end - 6, end).reduceRight((sum, byte) => sum * 256 + byte, 0);
      const stream = [system, component, bytes[end - 7]];
      const isOurs = isSigned && '' + signatureOf(bytes.slice(0, end)) == bytes.slice(end) && !(stamp <= latest[stream]);
      if (isOurs) time = Math.max(time, (latest[stream] = stamp));
      return isOurs;
    },
  };
}
