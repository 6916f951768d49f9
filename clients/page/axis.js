// Scales of the plots.

/** About `count` round values (1, 2, 5 times a power of ten) from 0 up to and past `high`; the last one is the end
 *  of the axis. */
export function linearTicks(high, count = 4) {
    if (!(high > 0)) return [0, 1];
    const rough = high / count, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].find((k) => k * power >= rough) * power;
    return Array.from({ length: Math.ceil(high / step - 1e-9) + 1 }, (_, k) => Number((k * step).toPrecision(6)));
}

/** Powers of ten around low ... high, at most four decades. */
export function logTicks(low, high) {
    if (!(high > 0)) return [0.1, 1];
    const last = Math.ceil(Math.log10(high) - 1e-9);
    const first = Math.min(last - 1, Math.max(last - 4, Math.floor(Math.log10(Math.max(low, high * 1e-9)))));
    return Array.from({ length: last - first + 1 }, (_, k) => 10 ** (first + k));
}

/** {place, ticks}: place(f) is 0 at the start of the axis and 1 at its end. */
export function makeScale({ low, high }, isLog) {
    const ticks = isLog ? logTicks(low, high) : linearTicks(high);
    const [start, end] = [ticks[0], ticks.at(-1)];
    const place = isLog
        ? (f) => (f <= start ? 0 : Math.min(1, Math.log(f / start) / Math.log(end / start)))
        : (f) => Math.min(1, Math.max(0, f / end));
    return { place, ticks };
}
