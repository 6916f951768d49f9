// The hemisphere of one incident direction, seen from above: equal areas of the disk are equal projected solid
// angles. Each pixel has the colour of the nearest direction of the table, nothing is smoothed.
import { element, svg } from "./dom.js";
import { direction, plain, withError } from "./format.js";
import { NearestDirections } from "./nearest.js";
import { toVector } from "./table.js";
import { viridis } from "./viridis.js";

const size = 360;
// Above so many directions their dots would hide the colours.
const mostDots = 400;

export class HemisphereMap {
    #pixels = [];

    constructor() {
        this.canvas = element("canvas", { width: size, height: size, role: "img", tabindex: 0 });
        this.marks = svg("svg", { viewBox: "-1.16 -1.16 2.32 2.32", class: "marks", "aria-hidden": "true" });
        this.readout = element("p", { class: "readout", role: "status" }, "Point at the map, or use the arrow keys on it, to read a value.");
        this.bar = element("canvas", { width: 256, height: 1, class: "bar", "aria-hidden": "true" });
        this.ends = element("div", { class: "ends" });
        this.box = element("div", { class: "hemisphere" }, element("div", { class: "disk" }, this.canvas, this.marks),
            element("div", { class: "colours" }, this.bar, this.ends), this.readout);
        this.canvas.addEventListener("pointermove", (event) => this.#read(event.offsetX / this.canvas.clientWidth, event.offsetY / this.canvas.clientHeight));
        this.canvas.addEventListener("keydown", (event) => {
            const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
            if (!step) return;
            event.preventDefault();
            this.#say(((this.cursor ?? -step) + step + this.samples.length) % this.samples.length);
        });
        const context = this.bar.getContext("2d"), strip = context.createImageData(256, 1);
        for (let x = 0; x < 256; x++) strip.data.set([...viridis(x / 255), 255], 4 * x);
        context.putImageData(strip, 0, 0);
    }

    /** `samples` of one incident direction, `scale` of makeScale(). */
    show(samples, wi, scale) {
        this.samples = samples;
        const key = samples.map((s) => s.outgoing).join();
        if (key !== this.key) this.#locate(samples);
        this.key = key;
        const context = this.canvas.getContext("2d"), image = context.createImageData(size, size);
        const colours = samples.map((s) => [...viridis(scale.place(s.f)), 255]);
        this.#pixels.forEach((sample, pixel) => sample >= 0 && image.data.set(colours[sample], 4 * pixel));
        context.putImageData(image, 0, 0);
        this.ends.replaceChildren(...scale.ticks.map((tick) => {
            const label = element("span", {}, plain(tick));
            label.style.left = `${100 * scale.place(tick)}%`;
            return label;
        }));
        this.#mark(samples, wi);
        const most = samples.reduce((a, b) => (b.f > a.f ? b : a), samples[0]);
        this.canvas.setAttribute("aria-label", `Hemisphere map, light from ${direction(wi)}; largest value ${plain(most.f)} per steradian at ${direction([most.theta, most.phi])}`);
    }

    #locate(samples) {
        const near = new NearestDirections(samples.map((s) => [s.theta, s.phi]));
        this.#pixels = new Int32Array(size * size).fill(-1);
        for (let row = 0; row < size; row++) {
            for (let column = 0; column < size; column++) {
                const x = (2 * column + 1) / size - 1, y = 1 - (2 * row + 1) / size, z2 = 1 - x * x - y * y;
                if (z2 > 0) this.#pixels[row * size + column] = near.find([x, y, Math.sqrt(z2)]).indices[0];
            }
        }
    }

    #mark(samples, wi) {
        const place = (angles) => toVector(angles).slice(0, 2);
        const dots = samples.length > mostDots ? [] : samples.map((s) => {
            const [x, y] = place([s.theta, s.phi]);
            return svg("circle", { class: "sample", cx: x, cy: -y, r: 0.009 });
        });
        const [x, y] = place(wi);
        const azimuths = [0, 90, 180, 270].map((phi) => {
            const turn = (phi * Math.PI) / 180;
            return svg("text", { x: 1.085 * Math.cos(turn), y: 0.025 - 1.085 * Math.sin(turn), "text-anchor": "middle" }, `${phi}°`);
        });
        this.cursor = undefined;
        this.marks.replaceChildren(svg("circle", { class: "rim", r: 1 }), ...dots, ...azimuths, svg("circle", { class: "cursor", r: 0.03, transform: "translate(9 9)" }),
            svg("circle", { class: "sun-halo", cx: x, cy: -y, r: 0.045 }), svg("circle", { class: "sun", cx: x, cy: -y, r: 0.045 }));
    }

    #read(u, v) {
        const column = Math.floor(u * size), row = Math.floor(v * size);
        const sample = this.#pixels[row * size + column];
        if (sample >= 0) this.#say(sample);
    }

    #say(index) {
        const sample = this.samples[index], [x, y] = toVector([sample.theta, sample.phi]);
        this.cursor = index;
        this.readout.textContent = `${direction([sample.theta, sample.phi])}: ${withError(sample.f, sample.sigma)} 1/sr`;
        this.marks.querySelector(".cursor").setAttribute("transform", `translate(${x} ${-y})`);
    }
}
