// The views of one table: lobes, hemisphere, orders, albedo, reciprocity, sphere. One pair of sliders, one channel
// and one scale serve all.
import { makeScale } from "./axis.js";
import { element, uniqueId } from "./dom.js";
import { percent, plain, withError } from "./format.js";
import { HemisphereMap } from "./hemisphere_map.js";
import { makeIncidence } from "./incidence.js";
import { lobePlot } from "./lobe_plot.js";
import { directionalAlbedo, quadrature, reciprocity } from "./numbers.js";
import { ordersView } from "./orders_view.js";
import { makeSphereView } from "./sphere.js";
import { inPlane } from "./table.js";

export const card = (title, ...children) => element("section", { class: "card", "aria-label": title }, element("h2", {}, title), children);

/** A select with a label; `choices`: [[value, text], ...]. */
export function chooser(label, choices, onchange) {
    const id = uniqueId("choose");
    const select = element("select", { id, onchange }, choices.map(([value, text]) => element("option", { value }, text)));
    return { select, box: element("div", { class: "chooser" }, element("label", { for: id }, label), select) };
}

export const scaleChooser = (onchange) => chooser("Scale", [["linear", "linear"], ["log", "logarithmic"]], onchange);
export const bandChooser = (onchange) => chooser("Error band", [["1", "± 1 σ"], ["10", "± 10 σ"], ["100", "± 100 σ"]], onchange);

/** Values of lobes as text: for screen readers, and for whoever wants the numbers. Open if the one in `box`, which
 *  it is to replace, was. */
export function lobeTable(lines, box) {
    const head = element("tr", {}, element("th", { scope: "col" }, "θ"), lines.map((line) => element("th", { scope: "col" }, `${line.label}, 1/sr`)));
    const angles = [...new Set(lines.flatMap((line) => line.points.map((p) => p.theta)))].sort((a, b) => a - b);
    const cell = (line, theta) => {
        const p = line.points.find((one) => one.theta === theta);
        return element("td", {}, p ? withError(p.f, p.sigma) : "");
    };
    return element("details", { open: box.querySelector("details")?.open }, element("summary", {}, "The values"), element("div", { class: "scroll", tabindex: 0 }, element("table", {}, element("thead", {}, head),
        element("tbody", {}, angles.map((theta) => element("tr", {}, element("th", { scope: "row" }, `${plain(theta)}°`), lines.map((line) => cell(line, theta))))))));
}

export function legend(lines) {
    return element("ul", { class: "legend" }, lines.map((line, k) => element("li", { class: `series-${k}` }, element("span", { class: "swatch" }), line.label)));
}

function fact(name, value, note) {
    return element("div", {}, element("dt", {}, name), element("dd", {}, value, note ? element("p", { class: "hint" }, note) : null));
}

export function reciprocityFacts(table, channel) {
    const found = reciprocity(table, channel);
    if (!found) return fact("Reciprocity", "–", "No pair of directions is in the table both ways.");
    return fact("Reciprocity", `${percent(found.rmsRelative)} rms`,
        `f(a, b) against f(b, a) in ${found.count} pairs: ${plain(found.rmsSigmas)} σ rms, ${plain(Math.abs(found.worst.sigmas))} σ at most.`);
}

function albedoFact(samples, cells) {
    if (!cells) return fact("Albedo", "–", "The outgoing directions are no set to integrate over: no weights, no full grid.");
    const { value, sigma } = directionalAlbedo(samples, cells.weights);
    return fact("Albedo", withError(value, sigma), `Directional, by ${cells.form}. The error is that of the values; that of the sum over so few directions is not in it.`);
}

/** The whole view of a table with its report. */
export function makeResultView(table, report) {
    // Of pairs, every direction has its own few partners: nothing to integrate over.
    const cells = table.pairs ? null : quadrature(table.outgoing);
    const lobes = element("div"), map = new HemisphereMap(), split = element("div"), facts = element("dl", { class: "facts" });
    const numbers = report.report;
    const draw = () => incidence.show();
    const channel = chooser("Channel", table.channels.map((name, k) => [k, name]), draw);
    const orderName = (k) => (k === 0 ? "all orders" : `order ${k}`);
    const order = chooser("Light", Array.from({ length: table.orders + 1 }, (_, k) => [k, orderName(k)]), draw);
    const scaling = scaleChooser(draw), band = bandChooser(draw);
    const reciprocityOf = new Map();

    const show = (incident) => {
        const c = Number(channel.select.value), k = Number(order.select.value), isLog = scaling.select.value === "log";
        const wi = table.incident[incident];
        const samples = table.samples(incident, c, k);
        // One scale for every incidence, so that moving the slider shows how the lobe grows.
        const scale = makeScale(table.range(c, k), isLog);
        const cut = inPlane(samples, wi);
        const lines = [{ label: `${orderName(k)}, channel ${table.channels[c]}`, ...cut }];
        lobes.replaceChildren(lobePlot(lines, { theta_i: wi[0], scale, bandSigmas: Number(band.select.value) }), legend(lines),
            cut.exact ? "" : element("p", { class: "hint" }, `No outgoing direction lies in the plane of incidence: the dots are the ${cut.points.length} within 7° of it.`), lobeTable(lines, lobes));
        map.show(samples, wi, scale);
        split.replaceChildren(ordersView(table, incident, c, cells));
        if (!reciprocityOf.has(c)) reciprocityOf.set(c, reciprocityFacts(table, c));
        facts.replaceChildren(albedoFact(table.samples(incident, c), cells), reciprocityOf.get(c),
            fact("Relative error", percent(numbers.relative_error), numbers.target_met ? "The target is met." : "The target was not reached."));
    };
    const incidence = makeIncidence(table.incident, show);
    const controls = element("div", { class: "card toolbar", role: "group", "aria-label": "What is shown" }, incidence.box,
        element("div", { class: "choosers" }, table.channels.length > 1 ? channel.box : null, table.orders ? order.box : null, scaling.box, band.box));
    draw();
    const warnings = [...(numbers.warnings ?? []), ...(report.surface?.warnings ?? [])];
    return element("div", { class: "result" }, controls,
        element("div", { class: "halves" },
            element("div", { class: "stack" }, card("Lobes in the plane of incidence", lobes), card("Orders of scattering", split),
                card("Numbers", facts, warnings.map((text) => element("p", { class: "warning" }, text)))),
            element("div", { class: "stack" }, card("Hemisphere", map.box), card("Sphere", makeSphereView(table)))));
}
