// A table on regular angles, as the sphere's texture needs it.
import { NearestDirections } from "./nearest.js";
import { toVector } from "./table.js";

export const thetaSteps = 24, phiSteps = 48;
const lastTheta = 89;

/** Angle of step k: from 0 to 89 degrees. */
const thetaOf = (k, steps) => (lastTheta * k) / (steps - 1);

/** Texels of f, RGBA, [incident theta][incident phi][outgoing theta][outgoing phi]: {texels, thetas, phis}. `phis` is
 *  1 for a table of one azimuth of light: then outgoing azimuths count from that of the light, as if the surface
 *  were isotropic. Between the directions of the table, the four nearest are weighed by their distance.
 *  `channels`: the three that become red, green and blue. */
export function resample(table, channels) {
    const azimuths = new Set(table.incident.filter(([theta]) => theta > 1e-6).map(([, phi]) => ((phi % 360) + 360) % 360));
    const isotropic = azimuths.size <= 1;
    const turn = isotropic ? [...azimuths][0] ?? 0 : 0;
    const thetas = isotropic ? 24 : 10, phis = isotropic ? 1 : 24;
    const outgoing = new NearestDirections(table.outgoing), incident = new NearestDirections(table.incident);
    const cells = [];
    for (let t = 0; t < thetaSteps; t++)
        for (let p = 0; p < phiSteps; p++) cells.push(outgoing.weights(toVector([thetaOf(t, thetaSteps), (360 * p) / phiSteps + turn])));

    const values = channels.map((channel) => table.incident.map((_, i) => table.samples(i, channel).map((s) => s.f)));
    const texels = new Float32Array(thetas * phis * cells.length * 4);
    let at = 0;
    for (let t = 0; t < thetas; t++) {
        for (let p = 0; p < phis; p++) {
            const lights = incident.weights(toVector([thetaOf(t, thetas), (360 * p) / phis + turn]));
            for (const views of cells) {
                for (const ofChannel of values) {
                    let f = 0;
                    for (const light of lights)
                        for (const view of views) f += light.weight * view.weight * ofChannel[light.index][view.index];
                    texels[at++] = f;
                }
                texels[at++] = 1;
            }
        }
    }
    return { texels, thetas, phis };
}
