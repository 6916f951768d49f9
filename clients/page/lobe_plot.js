// Polar plot of lobes in the plane of incidence, with error bands.
import { svg } from "./dom.js";
import { plain } from "./format.js";

const width = 520, height = 312, centre = 260, ground = 272, radius = 236;
const radians = Math.PI / 180;

function at(theta, r) {
    return [centre + radius * r * Math.sin(theta * radians), ground - radius * r * Math.cos(theta * radians)];
}
const text = ([x, y], content, more = {}) => svg("text", { x: x.toFixed(1), y: y.toFixed(1), ...more }, content);
const path = (points) => points.map(([x, y], k) => `${k ? "L" : "M"}${x.toFixed(1)} ${y.toFixed(1)}`).join("");

function frame(scale) {
    const rings = scale.ticks.slice(1).map((tick) => {
        const r = radius * scale.place(tick);
        return svg("path", { class: "grid", d: `M${centre - r} ${ground}A${r} ${r} 0 0 1 ${centre + r} ${ground}` });
    });
    const labels = scale.ticks.map((tick) => text([centre + radius * scale.place(tick), ground + 16], plain(tick), { class: "tick", "text-anchor": "middle" }));
    const spokes = [-60, -30, 0, 30, 60].map((theta) => {
        const [x, y] = at(theta, 1), [tx, ty] = at(theta, 1.06);
        return [svg("path", { class: "grid", d: `M${centre} ${ground}L${x.toFixed(1)} ${y.toFixed(1)}` }),
            text([tx, ty + 4], `${Math.abs(theta)}°`, { class: "tick", "text-anchor": theta < 0 ? "end" : theta > 0 ? "start" : "middle" })];
    });
    return [...rings, ...spokes.flat(), svg("path", { class: "ground", d: `M${centre - radius} ${ground}H${centre + radius}` }), ...labels];
}

function light(theta) {
    const [x1, y1] = at(-theta, 1), [x2, y2] = at(-theta, 0.08);
    return svg("path", { class: "light", "marker-end": "url(#arrow)", d: `M${x1.toFixed(1)} ${y1.toFixed(1)}L${x2.toFixed(1)} ${y2.toFixed(1)}` });
}

function lobe(line, index, scale, bandSigmas) {
    const place = (p, f) => at(p.theta, scale.place(Math.max(f, 0)));
    const name = `series-${index}`;
    const dots = line.points.map((p) => {
        const [x, y] = place(p, p.f);
        return svg("circle", { class: `dot ${name}`, cx: x.toFixed(1), cy: y.toFixed(1), r: line.exact && line.points.length > 12 ? 1.6 : 3 });
    });
    if (!line.exact) return dots;
    const upper = line.points.map((p) => place(p, p.f + bandSigmas * p.sigma));
    const lower = line.points.map((p) => place(p, p.f - bandSigmas * p.sigma)).reverse();
    return [svg("path", { class: `band ${name}`, d: `${path([...upper, ...lower])}Z` }),
        svg("path", { class: `lobe ${name}`, d: path(line.points.map((p) => place(p, p.f))) }), ...dots];
}

/** `lines`: [{label, points: [{theta, f, sigma}], exact}], drawn over each other; `scale` of makeScale(). */
export function lobePlot(lines, { theta_i, scale, bandSigmas }) {
    const arrow = svg("defs", {}, svg("marker", { id: "arrow", viewBox: "0 0 8 8", refX: 7, refY: 4, markerWidth: 7, markerHeight: 7, orient: "auto" },
        svg("path", { class: "arrow", d: "M0 0L8 4L0 8Z" })));
    const label = `Lobes in the plane of incidence, light at ${plain(theta_i)} degrees: ${lines.map((line) => line.label).join(", ")}`;
    const unit = text([width - 8, ground + 34], "f in 1/sr", { class: "tick", "text-anchor": "end" });
    const side = text([8, ground + 34], "◂ side of the light", { class: "tick" });
    return svg("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": label, class: "plot" },
        arrow, frame(scale), lines.map((line, k) => lobe(line, k, scale, bandSigmas)).flat(), light(theta_i), unit, side);
}
