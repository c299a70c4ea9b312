// Amplitude spectrum of real samples: Hann window, radix-2 FFT. Amplitudes are those of sines in the input.

export function amplitudes(samples) {
  const n = samples.length;
  if (n < 2 || (n & (n - 1)) !== 0) throw new RangeError(`${n} samples, expected a power of two`);
  let mean = 0;
  for (const value of samples) mean += value / n;
  const re = new Float64Array(n);
  const im = new Float64Array(n);
  let gain = 0;
  for (let k = 0; k < n; k++) {
    const weight = 0.5 - 0.5 * Math.cos((2 * Math.PI * k) / n);
    re[k] = (samples[k] - mean) * weight;
    gain += weight;
  }
  transform(re, im);
  const out = new Float64Array(n / 2 + 1);
  for (let k = 0; k < out.length; k++) {
    const sides = k === 0 || k === n / 2 ? 1 : 2;
    out[k] = (sides * Math.hypot(re[k], im[k])) / gain;
  }
  return out;
}

function transform(re, im) {
  const n = re.length;
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) {
      [re[i], re[j]] = [re[j], re[i]];
      [im[i], im[j]] = [im[j], im[i]];
    }
  }
  for (let size = 2; size <= n; size <<= 1) {
    const half = size >> 1;
    for (let k = 0; k < half; k++) {
      const c = Math.cos((-2 * Math.PI * k) / size);
      const s = Math.sin((-2 * Math.PI * k) / size);
      for (let a = k; a < n; a += size) {
        const b = a + half;
        const r = re[b] * c - im[b] * s;
        const i = re[b] * s + im[b] * c;
        re[b] = re[a] - r;
        im[b] = im[a] - i;
        re[a] += r;
        im[a] += i;
      }
    }
  }
}
