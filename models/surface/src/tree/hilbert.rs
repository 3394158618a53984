//! Order of points along a space-filling curve: neighbours in the order are close in space.

use flotor_hal::DVec3;

/// Returns the order of points along Hilbert's curve in their bounding box. Not real-time.
#[must_use]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // 0 to 2^20, fewer than 2^32 points
pub(crate) fn hilbert_order(points_m: &[DVec3]) -> Vec<u32> {
    const BITS: u32 = 20;
    let low = points_m.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points_m.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    let side = (high - low).max_element().max(f64::MIN_POSITIVE);
    let scale = f64::from((1_u32 << BITS) - 1) / side;
    let mut keys: Vec<(u64, u32)> = points_m
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let cell = ((*p - low) * scale).to_array().map(|x| x as u32);
            (hilbert_key(cell, BITS), i as u32)
        })
        .collect();
    keys.sort_unstable();
    keys.into_iter().map(|(_, i)| i).collect()
}

/// Returns the index of a cell along Hilbert's curve (Skilling 2004, AIP Conf. Proc. 707, 381).
fn hilbert_key(mut x: [u32; 3], bits: u32) -> u64 {
    let mut q = 1 << (bits - 1);
    while q > 1 {
        let p = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[i]) & p;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    q = 1 << (bits - 1);
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    x = x.map(|x| x ^ t);
    (0..bits).rev().fold(0, |key, bit| x.iter().fold(key, |key, x| (key << 1) | u64::from((x >> bit) & 1)))
}
