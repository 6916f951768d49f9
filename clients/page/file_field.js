// A file that goes to the server: a button, which is also where it is dropped, and the fields that say how it is read.
import { element } from "./dom.js";
import { makeGroup } from "./fields.js";
import { bytes } from "./format.js";
import { upload } from "./upload.js";

/** id: of the button; invitation, formats: what it says; fields: of job_fields.js; pointer: of the object in the
 *  request; onUploaded() is called when the server has the file. */
export function makeFileField({ id, invitation, formats, fields, pointer, onUploaded = () => {} }) {
    let sha256;
    const picker = element("input", { type: "file", id, class: "visually-hidden" });
    const state = element("span", { class: "hint", "aria-live": "polite" }, formats);
    const zone = element("label", { for: id, class: "drop" }, element("strong", {}, invitation), state);
    const group = makeGroup(fields, pointer);
    const error = element("p", { class: "error" });
    const take = async (file) => {
        state.textContent = `Uploading ${file.name} (${bytes(file.size)}) …`;
        try {
            sha256 = await upload(file);
            state.textContent = `${file.name}, ${bytes(file.size)}`;
            onUploaded();
        } catch (failure) {
            state.textContent = `${file.name} could not be uploaded: ${failure.message}`;
        }
    };
    picker.addEventListener("change", () => picker.files[0] && take(picker.files[0]));
    return {
        box: element("div", {}, element("div", { class: "field wide", "data-pointer": pointer }, picker, zone, error), group.box),
        read: () => ({ ...(sha256 && { sha256 }), ...group.read() }),
        take,
    };
}

/** Two ways to the same object, side by side: {name: {label, part: {box, read}}}. */
export function makeSegments(name, label, parts, chosen) {
    const shown = element("div");
    let current;
    const inputs = Object.fromEntries(Object.entries(parts).map(([value]) =>
        [value, element("input", { type: "radio", name, value, checked: value === chosen, onchange: () => choose(value) })]));
    const choose = (value) => {
        current = parts[value].part;
        inputs[value].checked = true;
        shown.replaceChildren(current.box);
    };
    choose(chosen);
    return {
        box: element("div", {}, element("div", { class: "segments", role: "radiogroup", "aria-label": label },
            Object.entries(parts).map(([value, one]) => element("label", {}, inputs[value], element("span", {}, one.label)))), shown),
        read: () => current.read(),
        choose,
    };
}
