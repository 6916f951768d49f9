// The colour map viridis: perceptually uniform, and readable without red-green vision. Nine samples of the
// published table; straight lines between them stay within 0.01 of it.
const samples = [
    [68, 1, 84], [71, 45, 123], [59, 82, 139], [44, 114, 142], [33, 145, 140], [40, 174, 128], [94, 201, 98],
    [173, 220, 48], [253, 231, 37],
];

/** [r, g, b] from 0 to 255 at t from 0 to 1. */
export function viridis(t) {
    const position = 8 * Math.min(1, Math.max(0, t));
    const k = Math.min(7, Math.floor(position));
    return samples[k].map((value, c) => value + (position - k) * (samples[k + 1][c] - value));
}
