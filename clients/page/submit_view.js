// A new measurement: the form, the height map, the preview, the sending.
import { execute, Problem } from "./api.js";
import { element } from "./dom.js";
import { clearErrors, makeChoice, makeGroup, showErrors } from "./fields.js";
import { bytes } from "./format.js";
import { accuracyFields, albedos, generators, incident, mapFields, orderFields, outgoing } from "./job_fields.js";
import { showPreview } from "./preview.js";
import { upload } from "./upload.js";

const section = (title, ...children) => element("fieldset", {}, element("legend", {}, title), children);

// The part of the form for an uploaded map: a button, which is also where files are dropped.
function makeHeightMap(onChosen) {
    let sha256;
    const picker = element("input", { type: "file", id: "height-map", class: "visually-hidden" });
    const state = element("span", { class: "hint", "aria-live": "polite" }, "GSF, PNG of 8 or 16 bit, OpenEXR, NumPy, PFM");
    const zone = element("label", { for: "height-map", class: "drop" },
        element("strong", {}, "Choose a height map, or drop it here"), state);
    const fields = makeGroup(mapFields, "/inputs/surface");
    const error = element("p", { class: "error" });
    const take = async (file) => {
        state.textContent = `Uploading ${file.name} (${bytes(file.size)}) …`;
        try {
            sha256 = await upload(file);
            state.textContent = `${file.name}, ${bytes(file.size)}`;
            onChosen();
        } catch (failure) {
            state.textContent = `${file.name} could not be uploaded: ${failure.message}`;
        }
    };
    picker.addEventListener("change", () => picker.files[0] && take(picker.files[0]));
    return {
        box: element("div", {}, element("div", { class: "field wide", "data-pointer": "/inputs/surface" }, picker, zone, error), fields.box),
        read: () => ({ ...(sha256 && { sha256 }), ...fields.read() }),
        take,
    };
}

/** The view. `onSubmitted(info)` gets the statusInfo of an accepted job. */
export function makeSubmitView(onSubmitted) {
    const generated = makeChoice("Relief", generators, "/inputs/surface", "gaussian");
    const heightMap = makeHeightMap(() => look());
    const surfaceBox = element("div");
    const sourceOf = (value, label, checked) => element("label", {},
        element("input", { type: "radio", name: "source", value, checked, onchange: () => choose(value) }), element("span", {}, label));
    const sources = element("div", { class: "segments", role: "radiogroup", "aria-label": "Source of the surface" },
        sourceOf("generated", "Generated", true), sourceOf("map", "Height map"));
    let surface = generated;
    const choose = (source) => {
        surface = source === "map" ? heightMap : generated;
        surfaceBox.replaceChildren(surface.box);
    };
    choose("generated");

    const albedo = makeChoice("Albedo of the facets", albedos, "/inputs/material", "grey");
    const incidence = makeChoice("Light from", incident, "/inputs/measure/incident", "angles");
    const exitance = makeChoice("Seen from", outgoing, "/inputs/measure/outgoing", "angles");
    const orders = makeGroup(orderFields, "/inputs/measure");
    const accuracy = makeGroup(accuracyFields, "/inputs/accuracy");
    const read = () => ({
        surface: surface.read(),
        material: { model: "lambertian", ...albedo.read() },
        measure: { kind: "brdf", incident: incidence.read(), outgoing: exitance.read(), ...orders.read() },
        accuracy: accuracy.read(),
    });

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
    const send = () => attempt(sendButton, async () => onSubmitted(await execute("brdf", read())));

    const form = element("form", { novalidate: true, "aria-label": "New measurement" },
        section("Surface", sources, surfaceBox), section("Material", albedo.box),
        section("Directions", incidence.box, exitance.box, orders.box), section("Accuracy", accuracy.box),
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
        sources.querySelector("[value=map]").checked = true;
        choose("map");
        heightMap.take(file);
    });
    return view;
}
