// A sphere of the material under one distant light, drawn by WebGL2 from the table.
import { element } from "./dom.js";
import { phiSteps, resample, thetaSteps } from "./sphere_table.js";

const vertexShader = `#version 300 es
void main() {
    gl_Position = vec4(vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0, 0.0, 1.0);
}`;

// Orthographic, seen along -z. The tangent frame turns with the sphere: x along the parallels.
const fragmentShader = `#version 300 es
precision highp float;
precision highp sampler2DArray;
uniform sampler2DArray table;
uniform vec2 size;
uniform vec3 light;
uniform float exposure;
uniform int thetas, phis;
out vec4 colour;
const float pi = 3.14159265358979;
const float lastTheta = 89.0 / 180.0 * pi;

vec3 layer(int t, int p, vec2 uv) {
    return texture(table, vec3(uv, float(t * phis + p))).rgb;
}

vec3 brdf(vec3 wi, vec3 wo) {
    float phiI = atan(wi.y, wi.x), phiO = atan(wo.y, wo.x);
    if (phis == 1) phiO -= phiI;
    ivec2 steps = textureSize(table, 0).xy;
    float v = acos(clamp(wo.z, -1.0, 1.0)) / lastTheta * float(steps.y - 1);
    vec2 uv = vec2(phiO / (2.0 * pi) + 0.5 / float(steps.x), (v + 0.5) / float(steps.y));
    float t = min(acos(clamp(wi.z, -1.0, 1.0)) / lastTheta, 1.0) * float(thetas - 1);
    float p = mod(phiI / (2.0 * pi) + 1.0, 1.0) * float(phis);
    int t0 = min(int(t), thetas - 2), p0 = int(p) % phis, p1 = (p0 + 1) % phis;
    float dt = t - float(t0), dp = fract(p);
    return mix(mix(layer(t0, p0, uv), layer(t0, p1, uv), dp), mix(layer(t0 + 1, p0, uv), layer(t0 + 1, p1, uv), dp), dt);
}

void main() {
    vec2 at = (2.0 * gl_FragCoord.xy - size) / min(size.x, size.y) * 1.04;
    float r2 = dot(at, at);
    if (r2 >= 1.0) { colour = vec4(0.0); return; }
    vec3 n = vec3(at, sqrt(1.0 - r2));
    vec3 x = normalize(cross(vec3(0.0, 1.0, 0.0), n)), y = cross(n, x);
    vec3 wi = vec3(dot(light, x), dot(light, y), dot(light, n));
    vec3 wo = vec3(x.z, y.z, n.z);
    vec3 radiance = wi.z > 0.0 ? brdf(wi, wo) * wi.z * exposure : vec3(0.0);
    vec3 shown = mix(12.92 * radiance, 1.055 * pow(radiance, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, radiance));
    float edge = clamp((1.0 - sqrt(r2)) * min(size.x, size.y) * 0.5, 0.0, 1.0);
    colour = vec4(clamp(shown, 0.0, 1.0) * edge, edge);
}`;

function compile(gl, type, source) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
}

function makeProgram(gl) {
    const program = gl.createProgram();
    gl.attachShader(program, compile(gl, gl.VERTEX_SHADER, vertexShader));
    gl.attachShader(program, compile(gl, gl.FRAGMENT_SHADER, fragmentShader));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    return program;
}

function loadTable(gl, { texels, thetas, phis }) {
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, gl.createTexture());
    gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGBA16F, phiSteps, thetaSteps, thetas * phis, 0, gl.RGBA, gl.FLOAT, texels);
    for (const [name, value] of [["MIN_FILTER", "LINEAR"], ["MAG_FILTER", "LINEAR"], ["WRAP_S", "REPEAT"], ["WRAP_T", "CLAMP_TO_EDGE"]])
        gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl[`TEXTURE_${name}`], gl[value]);
}

/** Draws into a canvas. Throws Error where WebGL2 is missing. */
class Sphere {
    constructor(canvas, resampled) {
        const gl = canvas.getContext("webgl2", { antialias: false });
        if (!gl) throw new Error("This browser has no WebGL 2, which the sphere needs.");
        this.gl = gl;
        this.program = makeProgram(gl);
        gl.useProgram(this.program);
        loadTable(gl, resampled);
        this.#set("1i", "thetas", resampled.thetas);
        this.#set("1i", "phis", resampled.phis);
        this.#set("2f", "size", canvas.width, canvas.height);
    }

    #set(kind, name, ...values) {
        this.gl[`uniform${kind}`](this.gl.getUniformLocation(this.program, name), ...values);
    }

    draw(light, exposure) {
        this.#set("3f", "light", ...light);
        this.#set("1f", "exposure", exposure);
        this.gl.drawArrays(this.gl.TRIANGLES, 0, 3);
    }
}

function slider(label, min, max, value, onChange) {
    const control = element("input", { type: "range", min, max, step: 1, value, oninput: onChange });
    return { control, box: element("label", { class: "slider" }, element("span", {}, label), control) };
}

/** The view: the sphere, its light by sliders or by dragging, its brightness. */
export function makeSphereView(table) {
    if (table.pairs) return element("p", { class: "quiet" }, "A sphere needs every incident with every outgoing direction; this table has pairs.");
    const isColour = table.channels.join() === "r,g,b";
    const resampled = resample(table, isColour ? [0, 1, 2] : [0, 0, 0]);
    const canvas = element("canvas", { width: 480, height: 480, class: "sphere", role: "img", "aria-label": "Sphere of the material under one light" });
    let sphere;
    try {
        sphere = new Sphere(canvas, resampled);
    } catch (error) {
        return element("p", { class: "quiet" }, error.message);
    }
    const draw = () => {
        const azimuth = (across.control.value * Math.PI) / 180, elevation = (up.control.value * Math.PI) / 180;
        const light = [Math.sin(azimuth) * Math.cos(elevation), Math.sin(elevation), Math.cos(azimuth) * Math.cos(elevation)];
        // At 0 stops a white Lambertian facet that faces the light is white.
        sphere.draw(light, Math.PI * 2 ** brightness.control.value);
    };
    const across = slider("Light, left to right", -180, 180, -40, draw);
    const up = slider("Light, up and down", -90, 90, 35, draw);
    const brightness = slider("Brightness, stops", -3, 5, 0, draw);
    canvas.addEventListener("pointermove", (event) => {
        if (!event.buttons) return;
        across.control.value = 180 * (event.offsetX / canvas.clientWidth - 0.5);
        up.control.value = 180 * (0.5 - event.offsetY / canvas.clientHeight);
        draw();
    });
    draw();
    const notes = [isColour ? null : `Channel ${table.channels[0]}, in grey.`,
        resampled.phis === 1 ? "The light has one azimuth in this table: the surface is taken as isotropic." : null,
        "Between the directions of the table the four nearest are blended; beyond its last angle the last value stands."];
    return element("div", { class: "sphere-view" }, canvas,
        element("div", { class: "sliders" }, across.box, up.box, brightness.box, element("p", { class: "hint" }, notes.filter(Boolean).join(" "))));
}
