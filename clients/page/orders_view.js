// How much of the light each order of scattering carries, at one incidence.
import { element } from "./dom.js";
import { percent, withError } from "./format.js";
import { directionalAlbedo } from "./numbers.js";

/** `cells` of quadrature(), or null: then plain sums over the outgoing directions. */
export function ordersView(table, incident, channel, cells) {
    if (table.orders === 0)
        return element("p", { class: "quiet" }, "This table has the sum of all orders. Ask for “each alone” under Directions to see them apart.");
    const weights = cells?.weights ?? new Array(table.outgoing.length).fill(1);
    const integral = (order) => directionalAlbedo(table.samples(incident, channel, order), weights);
    const all = integral(0);
    const parts = Array.from({ length: table.orders }, (_, k) => ({ name: String(k + 1), ...integral(k + 1) }));
    const rest = all.value - parts.reduce((sum, part) => sum + part.value, 0);
    if (rest > 1e-6 * all.value) parts.push({ name: `above ${table.orders}`, value: rest, sigma: null });
    const row = (part) => {
        const bar = element("span", { class: "bar" });
        bar.style.inlineSize = `${Math.max(0, Math.min(100, (100 * part.value) / all.value))}%`;
        return element("tr", {}, element("th", { scope: "row" }, part.name), element("td", { class: "bars" }, bar),
            element("td", {}, percent(part.value / all.value)),
            element("td", { class: "number" }, part.sigma === null ? "" : withError(part.value, part.sigma)));
    };
    return element("div", {}, element("table", { class: "orders" }, element("thead", {}, element("tr", {}, element("th", {}, "Order"), element("th", {}, ""), element("th", {}, "Part"),
        element("th", { class: "number" }, cells ? "Albedo" : "Sum of f"))), element("tbody", {}, parts.map(row))),
    cells ? null : element("p", { class: "hint" }, "The outgoing directions cannot be integrated over: these are parts of the plain sum of f."));
}
