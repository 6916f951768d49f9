// A new measurement: the form, the height map, the preview, the sending.
import { execute, Problem } from "./api.js";
import { element } from "./dom.js";
import { clearErrors, makeChoice, makeGroup, showErrors } from "./fields.js";
import { makeFileField, makeSegments } from "./file_field.js";
import { accuracyFields, bases, generators, mapFields, materials } from "./job_fields.js";
import { makeMeasureForm } from "./measure_form.js";
import { showPreview } from "./preview.js";

const section = (title, ...children) => element("fieldset", {}, element("legend", {}, title), children);

/** The view. `onSubmitted(info)` gets the statusInfo of an accepted job. */
export function makeSubmitView(onSubmitted) {
    const heightMap = makeFileField({ id: "height-map", invitation: "Choose a height map, or drop it here", formats: "GSF, PNG of 8 or 16 bit, OpenEXR, NumPy, PFM",
        fields: mapFields, pointer: "/inputs/surface", onUploaded: () => look() });
    const surface = makeSegments("source", "Source of the surface", {
        generated: { label: "Generated", part: makeChoice("Relief", generators, "/inputs/surface", "gaussian") },
        map: { label: "Height map", part: heightMap },
    }, "generated");
    const base = makeChoice("It stands on", bases, "/inputs/base", "flat");
    const material = makeChoice("Facets", materials, "/inputs/material", "grey");
    const measure = makeMeasureForm();
    const accuracy = makeGroup(accuracyFields, "/inputs/accuracy");
    const read = () => {
        const { process, inputs } = measure.read();
        const curved = base.chosen() === "curved" && { base: base.read() };
        return { process, inputs: { surface: surface.read(), ...curved, material: material.read(), ...inputs, accuracy: accuracy.read() } };
    };

    const preview = element("div", { class: "preview", role: "status" },
        element("p", { class: "quiet" }, "What the surface looks like, before anything is measured."));
    const message = element("p", { class: "error", role: "alert" });
    const lookButton = element("button", { type: "button", onclick: () => look() }, "Preview the surface");
    const sendButton = element("button", { type: "submit", class: "primary" }, "Measure");

    const refuse = (error) => {
        const homeless = error instanceof Problem && error.errors.length ? showErrors(form, error.errors) : [error.message];
        message.textContent = homeless.join(" ");
    };
    const attempt = async (button, action) => {
        clearErrors(form);
        message.textContent = "";
        button.disabled = true;
        try {
            await action();
        } catch (error) {
            refuse(error);
        }
        button.disabled = false;
    };
    const look = () => attempt(lookButton, () => showPreview(preview, surface.read()));
    const send = () => attempt(sendButton, async () => {
        const { process, inputs } = read();
        onSubmitted(await execute(process, inputs));
    });

    const form = element("form", { novalidate: true, "aria-label": "New measurement" },
        section("Surface", surface.box, base.box), section("Material", material.box),
        section("Measurement", measure.box), section("Accuracy", accuracy.box),
        element("div", { class: "actions" }, sendButton, message));
    form.addEventListener("submit", (event) => {
        event.preventDefault();
        send();
    });

    const view = element("div", { class: "columns" }, form,
        element("aside", { class: "card", "aria-label": "Preview" }, element("h2", {}, "Preview"), preview, lookButton));
    view.addEventListener("dragover", (event) => {
        event.preventDefault();
        view.classList.add("dragging");
    });
    view.addEventListener("dragleave", () => view.classList.remove("dragging"));
    view.addEventListener("drop", (event) => {
        event.preventDefault();
        view.classList.remove("dragging");
        const file = event.dataTransfer.files[0];
        if (!file) return;
        surface.choose("map");
        heightMap.take(file);
    });
    return view;
}
