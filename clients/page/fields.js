// Form fields that know where in the request their value stands, so that an error of the server finds them by
// its JSON pointer. Values are not judged here: the server does, and what it says is shown.
import { element, uniqueId } from "./dom.js";

const units = ["nm", "um", "mm", "cm", "m"];

// What each kind of field shows, and how its value is read; undefined leaves the key out.
const asNumber = (text) => (Number.isNaN(Number(text)) ? text : Number(text));
const input = (id, value, more = {}) => element("input", { id, type: "text", autocomplete: "off", value: value ?? "", ...more });
const textOf = (control) => control.value.trim() || undefined;

const kinds = {
    number: (id, field) => {
        const control = input(id, field.value, { inputmode: "decimal" });
        return { controls: [control], read: () => textOf(control) && asNumber(textOf(control)) };
    },
    // A whole number or "all".
    text: (id, field) => {
        const control = input(id, field.value);
        return { controls: [control], read: () => textOf(control) && asNumber(textOf(control)) };
    },
    numbers: (id, field) => {
        const control = input(id, field.value, { inputmode: "text", spellcheck: "false" });
        return { controls: [control], read: () => textOf(control)?.split(/[\s,;]+/).filter(Boolean).map(asNumber) };
    },
    length: (id, field) => {
        const [number, unit] = (field.value ?? "").split(" ");
        const control = input(id, number, { inputmode: "decimal" });
        const choice = element("select", { "aria-label": `Unit of ${field.label}` },
            units.map((name) => element("option", { value: name, selected: name === (unit ?? "mm") }, name.replace("um", "µm"))));
        return { controls: [control, choice], read: () => textOf(control) && `${textOf(control)} ${choice.value}` };
    },
    choice: (id, field) => {
        const control = element("select", { id }, Object.entries(field.choices).map(([value, label]) =>
            element("option", { value, selected: value === field.value }, label)));
        return { controls: [control], read: () => control.value };
    },
    check: (id, field) => {
        const control = element("input", { id, type: "checkbox", checked: field.value });
        return { controls: [control], read: () => control.checked || undefined };
    },
};

/** A labelled field. `field`: {key, label, kind, value, hint, choices}; `pointer`: of the object it belongs to. */
export function makeField(field, pointer) {
    const id = uniqueId(field.key);
    const { controls, read } = kinds[field.kind](id, field);
    const label = element("label", { for: id }, field.label);
    const hint = element("p", { class: "hint", id: `${id}-hint` }, field.hint ?? "");
    const error = element("p", { class: "error", id: `${id}-error` });
    controls[0].setAttribute("aria-describedby", `${id}-error ${id}-hint`);
    const box = element("div", { class: `field ${field.kind}`, "data-pointer": `${pointer}/${field.key}` },
        label, element("div", { class: "controls" }, controls), error, field.hint ? hint : null);
    return { box, read, key: field.key, control: controls[0] };
}

/** Fields below one object of the request. */
export function makeGroup(fields, pointer) {
    const made = fields.map((field) => makeField(field, pointer));
    return {
        box: element("div", { class: "fields" }, made.map((field) => field.box)),
        read: () => Object.fromEntries(made.map((field) => [field.key, field.read()]).filter(([, value]) => value !== undefined)),
        control: (key) => made.find((field) => field.key === key).control,
    };
}

/** Groups of which one is chosen by a select: {name: {label, fields, constant, compose}}; `constant` joins the value,
 *  `compose` makes the value of what the fields say. onChange(name) is told of every choice. */
export function makeChoice(label, groups, pointer, chosen, onChange = () => {}) {
    const id = uniqueId("choice");
    const select = element("select", { id }, Object.entries(groups).map(([name, group]) =>
        element("option", { value: name, selected: name === chosen }, group.label)));
    const made = Object.fromEntries(Object.entries(groups).map(([name, group]) => [name, makeGroup(group.fields, pointer)]));
    const error = element("p", { class: "error", id: `${id}-error` });
    select.setAttribute("aria-describedby", `${id}-error`);
    const shown = element("div");
    const show = () => {
        shown.replaceChildren(made[select.value].box);
        onChange(select.value);
    };
    select.addEventListener("change", show);
    show();
    return {
        box: element("div", { class: "alternatives" },
            element("div", { class: "field", "data-pointer": pointer },
                element("label", { for: id }, label), element("div", { class: "controls" }, select), error), shown),
        read: () => {
            const { constant, compose } = groups[select.value];
            const values = made[select.value].read();
            return { ...constant, ...(compose ? compose(values) : values) };
        },
        chosen: () => select.value,
    };
}

/** Takes the errors of the last attempt away. */
export function clearErrors(form) {
    for (const field of form.querySelectorAll("[data-pointer]")) {
        field.querySelector("[aria-invalid]")?.removeAttribute("aria-invalid");
        field.querySelector(".error").textContent = "";
    }
}

/** Shows each error {pointer, detail} at the field that is nearest above its pointer, and moves the focus to the
 *  first. Returns the texts of those that no field stands for. */
export function showErrors(form, errors) {
    const homeless = [];
    const fields = [...form.querySelectorAll("[data-pointer]")];
    const fits = (field, pointer) => `${pointer}/`.startsWith(`${field.dataset.pointer}/`);
    for (const { pointer, detail } of errors) {
        const field = fields.filter((one) => fits(one, pointer))
            .sort((a, b) => b.dataset.pointer.length - a.dataset.pointer.length)[0];
        if (!field) {
            homeless.push(`${pointer}: ${detail}`);
            continue;
        }
        field.querySelector("input, select").setAttribute("aria-invalid", "true");
        field.querySelector(".error").textContent = detail;
    }
    form.querySelector("[aria-invalid]")?.focus();
    return homeless;
}
