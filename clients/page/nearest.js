// Which directions are nearest to a given one.
import { toVector } from "./table.js";

/** Finds among `directions` ([theta, phi] in degrees). A search over all would be too slow for one per pixel, so
 *  they are sorted into cells of the projected disk, and cells are searched in growing squares. */
export class NearestDirections {
    #cells = new Map();

    constructor(directions) {
        this.vectors = directions.map(toVector);
        this.side = Math.max(1, Math.round(Math.sqrt(directions.length) / 2));
        this.vectors.forEach((v, k) => {
            const key = this.#key(...this.#cell(v));
            this.#cells.set(key, [...(this.#cells.get(key) ?? []), k]);
        });
    }

    #cell([x, y]) {
        return [x, y].map((c) => Math.min(this.side - 1, Math.floor(((c + 1) / 2) * this.side)));
    }
    #key(column, row) {
        return row * this.side + column;
    }

    /** Indices of the `count` nearest to the unit vector [x, y, z], nearest first, with squared chords:
     *  [{index, chord2}]. */
    find(vector, count = 1) {
        const [column, row] = this.#cell(vector);
        const found = [];
        const enough = Math.min(count, this.vectors.length);
        for (let reach = 0; reach <= this.side; reach++) {
            for (let r = row - reach; r <= row + reach; r++) {
                const step = Math.abs(r - row) === reach ? 1 : 2 * reach;
                for (let c = column - reach; c <= column + reach; c += step) this.#collect(c, r, vector, found);
            }
            found.sort((a, b) => a.chord2 - b.chord2);
            // Whatever was not looked at yet is at least `reach` cells away.
            if (found.length >= enough && found[enough - 1].chord2 <= ((2 * reach) / this.side) ** 2) break;
        }
        return found.slice(0, enough);
    }

    #collect(column, row, [x, y, z], found) {
        if (column < 0 || row < 0 || column >= this.side || row >= this.side) return;
        for (const index of this.#cells.get(this.#key(column, row)) ?? []) {
            const v = this.vectors[index];
            found.push({ index, chord2: (v[0] - x) ** 2 + (v[1] - y) ** 2 + (v[2] - z) ** 2 });
        }
    }

    /** The four nearest with weights that sum to 1: [{index, weight}]. */
    weights(vector) {
        const near = this.find(vector, 4);
        if (near[0].chord2 < 1e-12) return [{ index: near[0].index, weight: 1 }];
        const total = near.reduce((sum, one) => sum + 1 / one.chord2, 0);
        return near.map(({ index, chord2 }) => ({ index, weight: 1 / chord2 / total }));
    }
}
