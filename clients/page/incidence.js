// Two sliders over the incident directions of a table: theta, and phi among those of that theta.
import { element, uniqueId } from "./dom.js";
import { plain } from "./format.js";

function slider(label, onMoved) {
    const id = uniqueId("slider");
    const output = element("output", { for: id });
    const control = element("input", { type: "range", id, min: 0, step: 1, value: 0, oninput: onMoved });
    return { control, output, box: element("div", { class: "slider" }, element("label", { for: id }, label), control, output) };
}

/** `directions`: [[theta, phi], ...] in degrees; `onChange(k)` gets the index of the chosen one. */
export function makeIncidence(directions, onChange) {
    const rows = new Map();
    directions.forEach(([theta], k) => rows.set(theta, [...(rows.get(theta) ?? []), k]));
    const thetas = [...rows.keys()].sort((a, b) => a - b);
    const chosen = () => rows.get(thetas[theta.control.value])[phi.control.value];
    const say = (part, value, symbol) => {
        part.output.textContent = `${plain(value)}°`;
        part.control.setAttribute("aria-valuetext", `${symbol} ${plain(value)} degrees`);
    };
    const show = () => {
        const row = rows.get(thetas[theta.control.value]);
        phi.control.max = row.length - 1;
        phi.control.disabled = row.length < 2;
        say(theta, thetas[theta.control.value], "theta");
        say(phi, directions[chosen()][1], "phi");
        onChange(chosen());
    };
    const theta = slider("Light θ", () => show());
    const phi = slider("Light φ", () => show());
    theta.control.max = thetas.length - 1;
    theta.control.disabled = thetas.length < 2;
    theta.control.value = Math.floor(thetas.length / 2);
    return { box: element("div", { class: "incidence" }, theta.box, phi.box), show, chosen };
}
