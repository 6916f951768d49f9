// Numbers, times and sizes as people read them.

/** Value and one sigma with two digits of the sigma: "0.24956 ± 0.00052". */
export function withError(value, sigma) {
    if (!(sigma > 0)) return `${plain(value)} ± 0`;
    const decimals = Math.max(0, 1 - Math.floor(Math.log10(sigma)));
    if (decimals > 7 || Math.abs(value) >= 1e6) return `${plain(value)} ± ${sigma.toExponential(1)}`;
    return `${value.toFixed(decimals)} ± ${sigma.toFixed(decimals)}`;
}

/** Four significant digits, without trailing zeros. */
export function plain(value) {
    if (!Number.isFinite(value)) return "∞";
    return String(Number(value.toPrecision(4)));
}

export function percent(fraction) {
    return `${Number((100 * fraction).toPrecision(2))} %`;
}

/** "40 s", "3 min", "2 h". */
export function duration(seconds) {
    if (seconds < 1) return `${Number(seconds.toPrecision(1))} s`;
    if (seconds < 100) return `${Math.round(seconds)} s`;
    return seconds < 6000 ? `${Math.round(seconds / 60)} min` : `${Number((seconds / 3600).toPrecision(2))} h`;
}

export function bytes(count) {
    const units = ["B", "kB", "MB", "GB"];
    const power = Math.min(3, Math.max(0, Math.floor(Math.log10(Math.max(count, 1)) / 3)));
    return `${Number((count / 1000 ** power).toPrecision(3))} ${units[power]}`;
}

/** A length in metres with the unit that keeps it between 1 and 1000. */
export function length(metres) {
    const units = [["km", 1e3], ["m", 1], ["mm", 1e-3], ["µm", 1e-6], ["nm", 1e-9], ["pm", 1e-12]];
    const [name, size] = units.find(([, unit]) => Math.abs(metres) >= unit) ?? units.at(-1);
    return `${plain(metres / size)} ${name}`;
}

/** A direction: "θ 30°, φ 0°". */
export function direction([theta, phi]) {
    return `θ ${plain(theta)}°, φ ${plain(phi)}°`;
}

export function clock(time) {
    return new Date(time).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });
}
