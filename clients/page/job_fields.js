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

export const bases = {
    flat: { label: "A plane", fields: [] },
    curved: { label: "Curved", fields: [
        { key: "kappa_1", label: "Curvature κ₁, 1/m", kind: "number", value: "10", hint: "above 0: convex" },
        { key: "kappa_2", label: "Curvature κ₂, 1/m", kind: "number", value: "0" },
        { key: "direction_deg", label: "Direction of κ₁ from x, degrees", kind: "number", value: "0" }] },
};

const albedo = { key: "albedo", label: "Albedo", kind: "number", value: "0.8", hint: "0 to 1" };
const alpha = { key: "alpha", label: "Roughness α", kind: "number", value: "0.3", hint: "up to 1" };
const exponent = { key: "exponent", label: "Exponent", kind: "number", value: "20" };
const metal = { key: "metal", label: "Metal", kind: "choice", value: "Al",
    choices: { Al: "aluminium", Ag: "silver", Au: "gold", Cu: "copper", Fe: "iron" } };
const reflectance = { key: "reflectance", label: "Reflectance", kind: "number", value: "1", hint: "0 to 1, at all angles" };
const model = (name, label, fields) => ({ label, fields, constant: { model: name } });

export const materials = {
    grey: model("lambertian", "Lambertian, one albedo", [albedo]),
    colour: model("lambertian", "Lambertian, red, green, blue",
        [{ key: "albedo", label: "Albedo of red, green, blue", kind: "numbers", value: "0.8, 0.5, 0.3", hint: "each 0 to 1" }]),
    phong: model("phong", "Phong (Lafortune)", [exponent, albedo]),
    blinn_phong: model("blinn_phong", "Blinn-Phong", [exponent, albedo]),
    ggx_metal: model("ggx", "Rough metal, GGX", [alpha, metal]),
    ggx: model("ggx", "GGX without Fresnel", [alpha, reflectance]),
    beckmann_metal: model("beckmann", "Rough metal, Beckmann", [alpha, metal]),
    brushed: model("ggx", "Brushed metal, anisotropic GGX", [
        { ...alpha, key: "alpha_x", label: "α along the brush", value: "0.1" },
        { ...alpha, key: "alpha_y", label: "α across it", value: "0.4" },
        { key: "rotation_deg", label: "Direction of the brush from x, degrees", kind: "number", value: "0" }, metal]),
    coated_diffuse: model("coated_diffuse", "Varnish over a diffuse base", [
        { key: "eta", label: "Index of the varnish", kind: "number", value: "1.5" }, { ...alpha, value: "0.1" }, albedo]),
    mirror: model("mirror", "Mirrors (measured into receiver cells)", [metal]),
    mixture: { label: "Diffuse and glossy, mixed", fields: [
        { key: "share", label: "Diffuse share", kind: "number", value: "0.5", hint: "0 to 1; the rest is GGX" }, albedo, alpha, reflectance],
    compose: ({ share, albedo: diffuse, ...glossy }) => ({ model: "mixture", parts: [
        { weight: share, model: "lambertian", albedo: diffuse }, { weight: 1 - share, model: "ggx", ...glossy }] }) },
};

const directions = (theta, phi) => ({
    angles: { label: "Angles", fields: [
        { key: "theta_deg", label: "θ from the normal, degrees", kind: "numbers", value: theta, hint: "0 to below 90, separated by commas" },
        { key: "phi_deg", label: "φ azimuth, degrees", kind: "numbers", value: phi }] },
    hemisphere: { label: "Evenly over the hemisphere", fields: [
        { key: "hemisphere", label: "Number of directions", kind: "number", value: "64" }] },
    klems: { label: "Klems full basis, 145 patches", fields: [], constant: { klems: "full" } },
});

const bonn = { label: "Bonn data base, 81 directions", fields: [], constant: { bonn: 81 } };
const cells = (label, name) => ({ label, fields: [], constant: { cells: name } });

export const incident = { ...directions("0, 15, 30, 45, 60, 75", "0"), bonn };
export const outgoing = {
    ...directions("0, 5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 85",
        "0, 30, 60, 90, 120, 150, 180, 210, 240, 270, 300, 330"),
    bonn,
    klems_cells: cells("Receiver cells: Klems patches", "klems_full"),
    equal_cells: cells("Receiver cells: 64 of equal size", { equal: 64 }),
};

const maxOrder = { key: "max_order", label: "Orders of scattering", kind: "text", value: "all", hint: "“all”, or how many" };
const pixels = { key: "pixels", label: "Pixels, columns and rows", kind: "numbers", hint: "empty: one a point of the relief" };
const azimuths = { key: "azimuths", label: "Azimuths of direct light", kind: "number", value: "16" };
const samplesOf = { key: "samples", label: "Scattered samples", kind: "number", hint: "empty: a full grid" };

// What is measured: its kind, which directions it takes, its own keys. `compose` puts them in their place.
export const measurements = {
    brdf: { label: "BRDF, a table", kind: "brdf", takes: ["incident", "outgoing"], fields: [maxOrder,
        { key: "orders", label: "In the table", kind: "choice", value: "sum",
            choices: { sum: "their sum", separate: "their sum and each alone" } }] },
    projection: { label: "BRDF in spherical harmonics", kind: "brdf", takes: ["incident"], fields: [maxOrder,
        { key: "basis", label: "Basis", kind: "choice", value: "hsh",
            choices: { hsh: "hemispherical harmonics", sh: "spherical harmonics" } },
        { key: "order", label: "Order", kind: "number", value: "8", hint: "1 to 32" }, samplesOf],
    compose: ({ max_order, ...project }) => ({ max_order, project }) },
    btf: { label: "BTF: images from every side", kind: "btf", takes: ["incident", "outgoing"], fields: [maxOrder, pixels] },
    light_field: { label: "Light field", kind: "light_field", takes: ["incident", "outgoing"], fields: [maxOrder, pixels] },
    environment_field: { label: "Light field under an environment", kind: "light_field", takes: ["environment", "outgoing"], fields: [maxOrder, pixels, azimuths] },
    maps: { label: "Maps of light, shadow and sky", kind: "maps", takes: ["incident", "outgoing"], fields: [maxOrder,
        { key: "sky_directions", label: "Directions of the sky", kind: "number", value: "256" }] },
    relight: { label: "Under an environment", kind: "relight", takes: ["environment", "outgoing"], fields: [maxOrder, pixels, azimuths] },
};

export const uniformFields = [{ key: "radiance", label: "Radiance from everywhere", kind: "number", value: "1" }];
export const environmentFields = [
    { key: "rotation_deg", label: "Turned by, degrees", kind: "number", value: "0" },
    { key: "scale", label: "Brightness times", kind: "number", value: "1" },
];

export const accuracyFields = [
    { key: "target_relative_error", label: "Target relative error", kind: "number", value: "0.01", hint: "0.01 is 1 %" },
    { key: "max_seconds", label: "Stop after, seconds", kind: "number", hint: "empty: when the target is reached" },
    { key: "seed", label: "Seed", kind: "number", value: "1" },
];
