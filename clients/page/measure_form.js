// The part of the form that says what is measured: the kind, its directions or environment, its own keys.
import { element } from "./dom.js";
import { makeChoice, makeGroup } from "./fields.js";
import { makeFileField, makeSegments } from "./file_field.js";
import { environmentFields, incident, measurements, outgoing, uniformFields } from "./job_fields.js";

function makeEnvironment() {
    const uniform = makeGroup(uniformFields, "/inputs/environment");
    const map = makeFileField({ id: "environment-map", invitation: "Choose an environment map", formats: "Radiance .hdr or OpenEXR, equirectangular or cube",
        fields: environmentFields, pointer: "/inputs/environment" });
    return makeSegments("environment", "Source of the environment", { uniform: { label: "Uniform", part: uniform }, map: { label: "Map", part: map } }, "uniform");
}

/** {box, read}: read() is {process, inputs: {measure, environment}}. */
export function makeMeasureForm() {
    const parts = {
        incident: makeChoice("Light from", incident, "/inputs/measure/incident", "angles"),
        outgoing: makeChoice("Seen from", outgoing, "/inputs/measure/outgoing", "angles"),
        environment: makeEnvironment(),
    };
    const taken = element("div", { class: "parts" });
    const what = makeChoice("What", measurements, "/inputs/measure", "brdf", (name) =>
        taken.replaceChildren(...measurements[name].takes.map((part) => parts[part].box)));
    return {
        box: [what.box, taken],
        read: () => {
            const { kind, takes } = measurements[what.chosen()];
            const read = Object.fromEntries(takes.map((part) => [part, parts[part].read()]));
            const { environment, ...directions } = read;
            return { process: kind, inputs: { measure: { kind, ...directions, ...what.read() }, ...(environment && { environment }) } };
        },
    };
}
