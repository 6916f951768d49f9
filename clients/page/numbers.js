// Numbers about a whole table: albedo, reciprocity, differences.
import { directionKey } from "./table.js";

const radians = Math.PI / 180;
// Bounds of the rings of the Klems full basis, in degrees, and their azimuths (Klems 1994).
const klemsBounds = [0, 5, 15, 25, 35, 45, 55, 65, 75, 90];
const klemsCounts = [1, 8, 16, 20, 24, 24, 24, 16, 12];

/** Rings of equal theta, from the pole outwards: [{theta, members}] with indices of the directions. */
function ringsOf(directions) {
    const rings = new Map();
    directions.forEach(([theta], k) => {
        const key = theta.toFixed(6);
        rings.set(key, [...(rings.get(key) ?? []), k]);
    });
    return [...rings].map(([theta, members]) => ({ theta: Number(theta), members })).sort((a, b) => a.theta - b.theta);
}

function isEven(directions, members) {
    const phi = members.map((k) => ((directions[k][1] % 360) + 360) % 360).sort((a, b) => a - b);
    return phi.length >= 3 && phi.every((value, k) => {
        const gap = k + 1 < phi.length ? phi[k + 1] - value : phi[0] + 360 - value;
        return Math.abs(gap - 360 / phi.length) < 0.01;
    });
}

/** Projected solid angle (sr, they sum to pi) that each direction stands for: {weights, form}; null where the
 *  directions are no set over which one can integrate. */
export function quadrature(directions) {
    const n = directions.length;
    const isLattice = n >= 16 && directions.every(([theta], k) => Math.abs(Math.sin(theta * radians) ** 2 - (k + 0.5) / n) < 1e-6);
    if (isLattice) return { weights: directions.map(() => Math.PI / n), form: "directions of equal projected solid angle" };
    const rings = ringsOf(directions);
    if (rings.length < 3 || !rings.every((ring) => ring.theta < 1e-6 || isEven(directions, ring.members))) return null;
    const isKlems = rings.length === 9 && rings.every((ring, k) => ring.members.length === klemsCounts[k]);
    const middle = (k) => (rings[k - 1].theta + rings[k].theta) / 2;
    const bounds = isKlems ? klemsBounds : [0, ...rings.slice(1).map((_, k) => middle(k + 1)), 90];
    const weights = new Array(n).fill(0);
    rings.forEach((ring, k) => {
        const area = Math.PI * (Math.sin(bounds[k + 1] * radians) ** 2 - Math.sin(bounds[k] * radians) ** 2);
        for (const member of ring.members) weights[member] = area / ring.members.length;
    });
    return { weights, form: isKlems ? "Klems patches" : "the cells of the grid of angles" };
}

/** Part of the light that leaves: integral of f cos(theta_o). The values of a run share their errors, so their
 *  sigmas are added up, not averaged out. The error of the quadrature itself is not in it. */
export function directionalAlbedo(samples, weights) {
    let value = 0, sigma = 0;
    for (const s of samples) {
        value += weights[s.outgoing] * s.f;
        sigma += weights[s.outgoing] * s.sigma;
    }
    return { value, sigma };
}

function statistics(list) {
    if (list.length === 0) return null;
    const within = (k) => list.filter((d) => Math.abs(d.sigmas) <= k).length / list.length;
    const worst = list.reduce((a, b) => (Math.abs(b.sigmas) > Math.abs(a.sigmas) ? b : a));
    const rms = (of) => Math.sqrt(list.reduce((sum, d) => sum + of(d) ** 2, 0) / list.length);
    return { count: list.length, rmsSigmas: rms((d) => d.sigmas), rmsRelative: rms((d) => d.relative), worst, within: [1, 2, 3].map(within) };
}

function differenceOf(a, b) {
    const sigma = Math.hypot(a.sigma, b.sigma), mean = (a.f + b.f) / 2;
    const gap = a.f - b.f;
    return { sigmas: gap === 0 ? 0 : gap / sigma, relative: gap === 0 ? 0 : gap / mean };
}

/** How far f(a, b) and f(b, a) are apart, over all pairs of which the table has both; null if it has none. */
export function reciprocity(table, channel) {
    const there = new Map();
    table.incident.forEach((wi, i) => {
        for (const s of table.samples(i, channel)) there.set(`${directionKey(wi)}|${directionKey([s.theta, s.phi])}`, s);
    });
    const list = [];
    for (const [key, sample] of there) {
        const [a, b] = key.split("|");
        const mirrored = there.get(`${b}|${a}`);
        // Each pair once, and no direction with itself.
        if (a < b && mirrored) list.push({ ...differenceOf(sample, mirrored), at: `${a} | ${b}` });
    }
    return statistics(list);
}

/** How far two tables are apart where both have a value; null if they share no directions. */
export function difference(first, second, channel) {
    const otherChannel = second.channels.indexOf(first.channels[channel]);
    if (otherChannel < 0) return null;
    const list = [];
    for (const [i, j] of sharedIncidence(first, second)) {
        const others = new Map(second.samples(j, otherChannel).map((s) => [directionKey([s.theta, s.phi]), s]));
        for (const s of first.samples(i, channel)) {
            const other = others.get(directionKey([s.theta, s.phi]));
            if (other) list.push({ ...differenceOf(s, other), incident: first.incident[i], outgoing: [s.theta, s.phi] });
        }
    }
    return statistics(list);
}

/** Indices [i, j] of the incident directions that two tables share. */
export function sharedIncidence(first, second) {
    const known = new Map(second.incident.map((wi, j) => [directionKey(wi), j]));
    return first.incident.flatMap((wi, i) => (known.has(directionKey(wi)) ? [[i, known.get(directionKey(wi))]] : []));
}
