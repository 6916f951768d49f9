// The name of a surface: SHA-256 of its bytes, in hex. Browsers keep crypto.subtle from pages that came over
// plain HTTP from another machine; there the function below does it (FIPS 180-4), slower but the same.

// The first 32 bits of the fractions of the square and cube roots of the primes.
const primes = [];
for (let n = 2; primes.length < 64; n++) if (primes.every((p) => n % p)) primes.push(n);
const fraction32 = (x) => Math.floor((x - Math.floor(x)) * 2 ** 32) >>> 0;
const startState = primes.slice(0, 8).map((p) => fraction32(Math.sqrt(p)));
const roundConstants = Uint32Array.from(primes, (p) => fraction32(Math.cbrt(p)));

const rotate = (x, n) => (x >>> n) | (x << (32 - n));

function compress(state, block, schedule) {
    for (let t = 0; t < 16; t++) schedule[t] = block.getUint32(4 * t);
    for (let t = 16; t < 64; t++) {
        const a = schedule[t - 15], b = schedule[t - 2];
        const s0 = rotate(a, 7) ^ rotate(a, 18) ^ (a >>> 3);
        const s1 = rotate(b, 17) ^ rotate(b, 19) ^ (b >>> 10);
        schedule[t] = schedule[t - 16] + s0 + schedule[t - 7] + s1;
    }
    let [a, b, c, d, e, f, g, h] = state;
    for (let t = 0; t < 64; t++) {
        const choose = (e & f) ^ (~e & g), majority = (a & b) ^ (a & c) ^ (b & c);
        const t1 = h + (rotate(e, 6) ^ rotate(e, 11) ^ rotate(e, 25)) + choose + roundConstants[t] + schedule[t];
        const t2 = (rotate(a, 2) ^ rotate(a, 13) ^ rotate(a, 22)) + majority;
        [h, g, f, e, d, c, b, a] = [g, f, e, (d + t1) | 0, c, b, a, (t1 + t2) | 0];
    }
    [a, b, c, d, e, f, g, h].forEach((word, k) => (state[k] += word));
}

/** Of a Uint8Array. */
export function sha256InScript(bytes) {
    const state = Uint32Array.from(startState), schedule = new Uint32Array(64);
    const whole = bytes.length - (bytes.length % 64);
    for (let at = 0; at < whole; at += 64) compress(state, new DataView(bytes.buffer, bytes.byteOffset + at, 64), schedule);
    const rest = bytes.length - whole;
    const tail = new Uint8Array(rest < 56 ? 64 : 128);
    tail.set(bytes.subarray(whole));
    tail[rest] = 0x80;
    new DataView(tail.buffer).setBigUint64(tail.length - 8, 8n * BigInt(bytes.length));
    for (let at = 0; at < tail.length; at += 64) compress(state, new DataView(tail.buffer, at, 64), schedule);
    return Array.from(state, (word) => word.toString(16).padStart(8, "0")).join("");
}

/** Of a Uint8Array. */
export async function sha256(bytes) {
    if (!globalThis.crypto?.subtle) return sha256InScript(bytes);
    const digest = new Uint8Array(await crypto.subtle.digest("SHA-256", bytes));
    return Array.from(digest, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
