// Elements without markup in strings: what a user or the server wrote can never become HTML.

function build(made, attributes, children) {
    for (const [name, value] of Object.entries(attributes)) {
        if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
        else if (value === true) made.setAttribute(name, "");
        else if (value !== false && value !== null && value !== undefined) made.setAttribute(name, value);
    }
    made.append(...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false));
    return made;
}

/** An element with attributes, listeners ("onclick") and children; empty attributes and children are left out. */
export function element(tag, attributes = {}, ...children) {
    return build(document.createElement(tag), attributes, children);
}

/** The same in the namespace of SVG. */
export function svg(tag, attributes = {}, ...children) {
    return build(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);
}

let count = 0;
/** An id that no other element has: what ties labels, hints and errors to their field. */
export function uniqueId(name) {
    count += 1;
    return `${name}-${count}`;
}
