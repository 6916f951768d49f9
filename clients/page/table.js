// A BRDF table as gonio writes it in JSON (core/table/io/json.cpp): flat arrays, last axis fastest.

const radians = Math.PI / 180;
export const toVector = ([theta, phi]) => [
    Math.sin(theta * radians) * Math.cos(phi * radians),
    Math.sin(theta * radians) * Math.sin(phi * radians),
    Math.cos(theta * radians),
];

/** Turn from b to a in degrees, -180 to 180. */
export function azimuthDifference(a, b) {
    const turn = (a - b) % 360;
    return turn > 180 ? turn - 360 : turn <= -180 ? turn + 360 : turn;
}

/** Equal for equal directions: azimuths that differ by whole turns, any azimuth at the pole. */
export function directionKey([theta, phi]) {
    if (Math.abs(theta) < 1e-6) return "0";
    return `${theta.toFixed(5)} ${((((phi % 360) + 360) % 360) % 360).toFixed(5)}`;
}

export class Table {
    /** `document`: the parsed JSON. Throws Error for what is no table. */
    constructor(document) {
        if (document.format !== "gonio-table" || document.version !== 1) throw new Error("This is no table that the page can read.");
        const axis = (name) => document.axes.find((one) => one.name === name).values;
        this.channels = axis("channel");
        /** How many orders of scattering have a slice of their own; slice 0 is the sum of all. */
        this.orders = axis("order").length - 1;
        /** [theta, phi] in degrees. */
        this.incident = axis("incident");
        this.outgoing = axis("outgoing");
        this.pairs = document.pairs;
        this.provenance = new Map(document.provenance);
        this.f = document.values;
        // One sigma of all that is known: noise and bias together.
        this.sigma = document.standard_error.map((error, k) => Math.hypot(error, document.bias[k]));
        this.rows = this.pairs ? this.pairs.length : this.incident.length * this.outgoing.length;
    }

    /** Every outgoing sample {outgoing, theta, phi, f, sigma} of one incident direction; f in 1/sr. */
    samples(incident, channel, order = 0) {
        const first = (channel * (this.orders + 1) + order) * this.rows;
        const sample = (outgoing, row) => {
            const [theta, phi] = this.outgoing[outgoing];
            return { outgoing, theta, phi, f: this.f[first + row], sigma: this.sigma[first + row] };
        };
        if (!this.pairs) return this.outgoing.map((_, o) => sample(o, incident * this.outgoing.length + o));
        return this.pairs.flatMap(([i, o], row) => (i === incident ? [sample(o, row)] : []));
    }

    /** Largest f and smallest f above 0 of one slice. */
    range(channel, order = 0) {
        const first = (channel * (this.orders + 1) + order) * this.rows;
        let low = Infinity, high = 0;
        for (let k = first; k < first + this.rows; k++) {
            if (this.f[k] > 0 && this.f[k] < low) low = this.f[k];
            if (this.f[k] > high) high = this.f[k];
        }
        return { low: Math.min(low, high), high };
    }
}

/** Samples in the plane of incidence by signed theta (negative on the side of the light). Where no sample lies
 *  in it, those within `near_deg` of it: {points: [{theta, f, sigma}], exact}. */
export function inPlane(samples, [, phi_i], near_deg = 7) {
    const distance = ({ theta, phi }) =>
        Math.asin(Math.abs(Math.sin(theta * radians) * Math.sin((phi - phi_i) * radians))) / radians;
    const signed = (s) => (Math.abs(azimuthDifference(s.phi, phi_i)) < 90 ? -s.theta : s.theta);
    const within = (limit) => {
        const points = samples.filter((s) => distance(s) <= limit).map((s) => ({ theta: signed(s) || 0, f: s.f, sigma: s.sigma }));
        points.sort((a, b) => a.theta - b.theta);
        // Grids hold the pole once an azimuth.
        return points.filter((p, k) => k === 0 || p.theta !== 0 || points[k - 1].theta !== 0);
    };
    const exact = within(0.01);
    return exact.length >= 2 ? { points: exact, exact: true } : { points: within(near_deg), exact: false };
}
