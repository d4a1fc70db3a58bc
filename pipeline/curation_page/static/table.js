// Clip table with typed arrays as columns: filters, sorting, histograms.

export class ClipTable {
  constructor(columns) {
    this.version = columns.version;
    this.robot = columns.robot;
    this.database = columns.database;
    this.clip = columns.clip;
    this.lower = columns.clip.map((name) => name.toLowerCase());
    this.thumbnail = columns.thumbnail;
    this.texts = columns.texts;
    this.count = columns.clip.length;
    this.figures = columns.figures.map((figure) => ({
      ...figure,
      values: Float64Array.from(figure.values, (value) => (value === null ? NaN : value)),
    }));
    this.byName = new Map(this.figures.map((figure) => [figure.name, figure]));
    this.place = new Map(columns.clip.map((name, index) => [name, index]));
  }

  text(name, index) {
    const column = this.texts[name];
    return column.names[column.codes[index]];
  }

  // Indices of the clips that meet all filters, sorted. `ranges`: figure -> [low, high]; `texts`: facet -> value.
  chosen({ query = "", texts = {}, ranges = {}, sort = "clip", descending = false }) {
    const words = query.toLowerCase().split(/\s+/).filter(Boolean);
    const filters = Object.entries(texts).map(([name, value]) => [this.texts[name]?.codes, this.texts[name]?.names.indexOf(value)]);
    if (filters.some(([codes]) => codes === undefined)) return new Uint32Array(0);
    const bounds = Object.entries(ranges).filter(([name]) => this.byName.has(name)).map(([name, range]) => [this.byName.get(name).values, ...range]);
    const kept = new Uint8Array(this.count);
    for (let index = 0; index < this.count; index += 1) {
      if (filters.every(([codes, code]) => codes[index] === code)
        && bounds.every(([values, low, high]) => values[index] >= low && values[index] <= high)
        && words.every((word) => this.lower[index].includes(word))) kept[index] = 1;
    }
    return this.order(sort, descending).filter((index) => kept[index]);
  }

  // Indices of all clips in sorted order (cached); clips without the figure come last.
  order(sort, descending) {
    const key = `${sort} ${descending}`;
    this.orders ??= new Map();
    if (!this.orders.has(key)) {
      const all = Uint32Array.from({ length: this.count }, (_, index) => index);
      const values = this.byName.get(sort)?.values;
      const sign = descending ? -1 : 1;
      const unknown = (value) => (Number.isNaN(value) ? 1 : 0);
      if (values) all.sort((one, two) => unknown(values[one]) - unknown(values[two]) || sign * (values[one] - values[two]) || one - two);
      else if (descending) all.reverse();
      this.orders.set(key, all);
    }
    return this.orders.get(key);
  }

  countsOf(name, indices) {
    const column = this.texts[name];
    const counts = new Array(column.names.length).fill(0);
    for (const index of indices) counts[column.codes[index]] += 1;
    return column.names.map((text, place) => [text, counts[place]]);
  }
}

// Range of a histogram: the central 99 % of the values, extended to the thresholds.
export function ends(figure) {
  if (figure.ends) return figure.ends;
  const known = Float64Array.from(figure.values.filter((value) => !Number.isNaN(value))).sort();
  if (!known.length) return [0, 1];
  let low = known[Math.floor(0.005 * (known.length - 1))];
  let high = known[Math.ceil(0.995 * (known.length - 1))];
  for (const threshold of figure.thresholds ?? []) [low, high] = [Math.min(low, threshold), Math.max(high, threshold)];
  if (!(high > low)) [low, high] = [low - 0.5, high + 0.5];
  figure.ends = [low - 0.02 * (high - low), high + 0.02 * (high - low)];
  return figure.ends;
}

export function histogram(figure, indices, bins) {
  const [low, high] = ends(figure);
  const counts = new Uint32Array(bins);
  const add = (value) => {
    if (!Number.isNaN(value)) counts[Math.min(Math.max(Math.floor(((value - low) / (high - low)) * bins), 0), bins - 1)] += 1;
  };
  if (indices === null) figure.values.forEach(add);
  else for (const index of indices) add(figure.values[index]);
  return counts;
}
