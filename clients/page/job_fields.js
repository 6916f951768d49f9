// The fields of the form, section by section; server/README.md explains each key. A new generated surface or a
// new form of directions is one entry here.

const samples = { key: "samples", label: "Points along x", kind: "number", value: "128" };
const period = { key: "period", label: "Period", kind: "length", value: "100 um" };
const amplitude = { key: "amplitude", label: "Amplitude", kind: "length", value: "10 um" };
const pitch = { key: "pitch", label: "Pitch", kind: "length", value: "1 um", hint: "distance of neighbouring points" };

const generator = (name, label, fields) => [name, { label, fields, constant: { generate: name } }];

export const generators = Object.fromEntries([
    generator("gaussian", "Gaussian random field", [samples, pitch,
        { key: "correlation_length", label: "Correlation length", kind: "length", value: "4 um" },
        { key: "rms_slope", label: "RMS slope", kind: "number", value: "0.7", hint: "rms of the gradient; 1 is 45°" },
        { key: "seed", label: "Seed", kind: "number", value: "1" }]),
    generator("v_groove", "V-grooves", [samples, period,
        { key: "slope_deg", label: "Slope of the walls, degrees", kind: "number", value: "45" }]),
    generator("rectangular_groove", "Rectangular grooves", [samples, period,
        { key: "groove_width", label: "Groove width", kind: "length", value: "50 um" },
        { key: "groove_depth", label: "Groove depth", kind: "length", value: "50 um" }]),
    generator("sinusoid", "Sinusoid", [samples, period, amplitude]),
    generator("egg_crate", "Egg crate", [samples, period, amplitude]),
    generator("spherical_pits", "Spherical pits", [samples, period,
        { key: "radius", label: "Radius", kind: "length", value: "40 um" },
        { key: "eta_deg", label: "Half opening angle, degrees", kind: "number", value: "60" }]),
    generator("plane", "Plane", [samples, pitch]),
]);

export const mapFields = [
    { key: "width", label: "Width of the whole map", kind: "length", hint: "leave empty if the file says it" },
    { key: "height_range", label: "Height range", kind: "length",
        hint: "height of the brightest value above black; empty if the file says it" },
    { key: "boundary", label: "Beyond the edge", kind: "choice", value: "periodic",
        choices: { periodic: "repeats", mirror: "is mirrored", open: "is unknown: a border is left out" } },
    { key: "level", label: "Take away", kind: "choice", value: "none",
        choices: { none: "nothing", mean: "the mean", plane: "a tilted plane", quadratic: "a curved form" } },
    { key: "invert", label: "Large values are deep", kind: "check" },
];

export const albedos = {
    grey: { label: "One value", fields: [{ key: "albedo", label: "Albedo", kind: "number", value: "0.8", hint: "0 to 1" }] },
    colour: { label: "Red, green, blue",
        fields: [{ key: "albedo", label: "Albedo of red, green, blue", kind: "numbers", value: "0.8, 0.5, 0.3", hint: "each 0 to 1" }] },
};

const directions = (theta, phi) => ({
    angles: { label: "Angles", fields: [
        { key: "theta_deg", label: "θ from the normal, degrees", kind: "numbers", value: theta, hint: "0 to below 90, separated by commas" },
        { key: "phi_deg", label: "φ azimuth, degrees", kind: "numbers", value: phi }] },
    hemisphere: { label: "Evenly over the hemisphere", fields: [
        { key: "hemisphere", label: "Number of directions", kind: "number", value: "64" }] },
    klems: { label: "Klems full basis, 145 patches", fields: [], constant: { klems: "full" } },
});

export const incident = directions("0, 15, 30, 45, 60, 75", "0");
export const outgoing = directions("0, 5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 85",
    "0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330");

export const orderFields = [
    { key: "max_order", label: "Orders of scattering", kind: "text", value: "all", hint: "“all”, or how many" },
    { key: "orders", label: "In the table", kind: "choice", value: "sum",
        choices: { sum: "their sum", separate: "their sum and each alone" } },
];

export const accuracyFields = [
    { key: "target_relative_error", label: "Target relative error", kind: "number", value: "0.01", hint: "0.01 is 1 %" },
    { key: "max_seconds", label: "Stop after, seconds", kind: "number", hint: "empty: when the target is reached" },
    { key: "seed", label: "Seed", kind: "number", value: "1" },
];
