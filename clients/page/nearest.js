// Which directions are nearest to a given one.
import { toVector } from "./table.js";

/** Finds among `directions` ([theta, phi] in degrees). A search over all would be too slow for one per pixel, so
 *  they are sorted into cells of the projected disk, and cells are searched in growing squares. */
export class NearestDirections {
    constructor(directions) {
        this.vectors = directions.map(toVector);
        this.side = Math.max(1, Math.round(Math.sqrt(directions.length) / 2));
        this.cells = Array.from({ length: this.side ** 2 }, () => []);
        this.vectors.forEach(([x, y], k) => this.cells[this.#cell(y) * this.side + this.#cell(x)].push(k));
    }

    #cell(coordinate) {
        return Math.min(this.side - 1, Math.floor(((coordinate + 1) / 2) * this.side));
    }

    /** Indices of the `count` nearest to the unit vector, nearest first, and their squared chords. */
    find(vector, count = 1) {
        const column = this.#cell(vector[0]), row = this.#cell(vector[1]);
        const best = { indices: [], chords2: [] };
        const enough = Math.min(count, this.vectors.length);
        for (let reach = 0; reach <= this.side; reach++) {
            for (let r = Math.max(0, row - reach); r <= Math.min(this.side - 1, row + reach); r++) {
                const step = Math.abs(r - row) === reach ? 1 : 2 * reach;
                for (let c = column - reach; c <= column + reach; c += step) {
                    if (c >= 0 && c < this.side) this.#collect(this.cells[r * this.side + c], vector, enough, best);
                }
            }
            // Whatever was not looked at yet is at least `reach` cells away.
            if (best.indices.length === enough && best.chords2[enough - 1] <= ((2 * reach) / this.side) ** 2) break;
        }
        return best;
    }

    #collect(cell, [x, y, z], enough, { indices, chords2 }) {
        for (const index of cell) {
            const v = this.vectors[index];
            const chord2 = (v[0] - x) ** 2 + (v[1] - y) ** 2 + (v[2] - z) ** 2;
            let place = indices.length;
            while (place > 0 && chords2[place - 1] > chord2) place--;
            if (place === enough) continue;
            indices.splice(place, 0, index);
            chords2.splice(place, 0, chord2);
            indices.length = chords2.length = Math.min(indices.length, enough);
        }
    }

    /** The four nearest with weights that sum to 1: [{index, weight}]. */
    weights(vector) {
        const { indices, chords2 } = this.find(vector, 4);
        if (chords2[0] < 1e-12) return [{ index: indices[0], weight: 1 }];
        const total = chords2.reduce((sum, chord2) => sum + 1 / chord2, 0);
        return indices.map((index, k) => ({ index, weight: 1 / chords2[k] / total }));
    }
}
