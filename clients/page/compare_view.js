// Two tables over each other.
import { getJson } from "./api.js";
import { makeScale } from "./axis.js";
import { element } from "./dom.js";
import { direction, percent, plain } from "./format.js";
import { makeIncidence } from "./incidence.js";
import { lobePlot } from "./lobe_plot.js";
import { difference, sharedIncidence } from "./numbers.js";
import { loadResult } from "./result.js";
import { bandChooser, card, chooser, legend, lobeTable, scaleChooser } from "./result_view.js";
import { inPlane } from "./table.js";

function numbersOf(first, second, channel) {
    const found = difference(first, second, channel);
    if (!found) return element("p", { class: "quiet" }, "They share no pair of directions in this channel.");
    const row = (name, value) => element("div", {}, element("dt", {}, name), element("dd", {}, value));
    return element("div", {}, element("dl", { class: "facts" }, row("Difference, rms", percent(found.rmsRelative)), row("In sigmas, rms", `${plain(found.rmsSigmas)} σ`),
        row("Largest", `${plain(Math.abs(found.worst.sigmas))} σ`), row("Within 1, 2, 3 σ", found.within.map(percent).join(", ")), row("Values compared", String(found.count))),
    element("p", { class: "hint" }, `σ is that of both tables together. Largest: light ${direction(found.worst.incident)}, view ${direction(found.worst.outgoing)}. Were they the same but for noise, about 68, 95 and 99.7 % would lie within.`));
}

/** Fills `box` with the comparison of the jobs `ids`: [first, second]. */
export async function showComparison(box, ids) {
    box.replaceChildren(element("p", { class: "quiet", role: "status" }, "Fetching two tables …"));
    const loaded = await Promise.all(ids.map(async (id) => loadResult(await getJson(`/jobs/${id}`))));
    const names = ids.map((id) => `job ${id.slice(0, 8)}`);
    const head = element("div", { class: "head" }, element("h1", {}, "Comparison"),
        ids.map((id, k) => element("a", { class: "mono", href: `#job=${id}` }, names[k])));
    const tables = loaded.map((one) => one.table);
    const large = tables.find((table) => table.tooLarge);
    const pairs = large ? [] : sharedIncidence(...tables);
    if (pairs.length === 0) {
        const why = large ? `A table of ${large.tooLarge} is too much to draw here.` : "The two share no incident direction.";
        box.replaceChildren(head, element("p", { class: "card quiet" }, why));
        return;
    }
    const [first, second] = tables;
    const lobes = element("div"), numbers = element("div");
    const draw = () => incidence.show();
    const channel = chooser("Channel", first.channels.map((name, k) => [k, name]), draw), scaling = scaleChooser(draw), band = bandChooser(draw);
    const show = (chosen) => {
        const c = Number(channel.select.value), other = Math.max(0, second.channels.indexOf(first.channels[c]));
        const [i, j] = pairs[chosen], wi = first.incident[i];
        const ranges = [first.range(c), second.range(other)];
        const scale = makeScale({ low: Math.min(...ranges.map((r) => r.low)), high: Math.max(...ranges.map((r) => r.high)) }, scaling.select.value === "log");
        const lines = [first.samples(i, c), second.samples(j, other)].map((samples, k) => ({ label: names[k], ...inPlane(samples, wi) }));
        lobes.replaceChildren(lobePlot(lines, { theta_i: wi[0], scale, bandSigmas: Number(band.select.value) }), legend(lines), lobeTable(lines, lobes));
        if (numbers.dataset.channel !== String(c)) numbers.replaceChildren(numbersOf(first, second, c));
        numbers.dataset.channel = c;
    };
    const incidence = makeIncidence(pairs.map(([i]) => first.incident[i]), show);
    draw();
    box.replaceChildren(head, element("div", { class: "card toolbar", role: "group", "aria-label": "What is shown" }, incidence.box,
        element("div", { class: "choosers" }, first.channels.length > 1 ? channel.box : null, scaling.box, band.box)),
        element("div", { class: "halves" }, element("div", { class: "stack" }, card("Lobes over each other", lobes)),
            element("div", { class: "stack" }, card("How far apart", numbers))));
}
