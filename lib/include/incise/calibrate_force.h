/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Sensitivity of a force channel, from weights and readings. The procedure follows ISO 376
 * (ascending and descending series of loads) without claiming compliance. A pure function on
 * arrays; no device and no file. Part of libincise-learn.
 *
 *     reading
 *      mV |            x    F = m g (1 - air/weight)
 *         |        x/       reading = zero + sensitivity F
 *         |     x/
 *         |  x/             weighted line through the mean of each load
 *         +------------ F, N
 */
#ifndef INCISE_CALIBRATE_FORCE_H
#define INCISE_CALIBRATE_FORCE_H

#include <stdbool.h>
#include <incise/calibration.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A load and the reading of the channel. */
struct incise_calibrate_force_pair {
	double mass_g;	   /**< 0 … 1e6; NAN: use force_N */
	double force_N;	   /**< 0 … 1e4; ignored if mass_g is given */
	double reading_mV; /**< -1e6 … 1e6 */
	int series;	   /**< number of the run through the loads */
	bool descending;   /**< reached by removing weight */
};

/** Settings; comments begin with the defaults of incise_calibrate_force_init(). */
struct incise_calibrate_force_setup {
	double gravity_m_s2, gravity_u_m_s2; /**< 9.80665, 0.0173: anywhere on Earth */
	double air_kg_m3, air_u_kg_m3;	     /**< 1.2, 0.058: ±0.1, rectangular */
	double weight_kg_m3, weight_u_kg_m3; /**< 7950, 350: steel or brass */
	/**
	 * Resolution of the weighing scale, g. The rounding error is rectangular, equal for all
	 * readings of a load, and 0 for an empty pan. 0.5 (Song et al. 2006, §2). For loads in
	 * N: this times gravity.
	 */
	double scale_g;
	double low_mV, high_mV; /**< ends of the converter; NAN: unknown */
	double step_mV;		/**< one code; 0: unknown */
	/** Each reading is a mean over noise of at least half a code: finer than one code. */
	bool dithered;
	double nominal_mV_N; /**< 1240 */
	double tolerance;    /**< 0.05; largest relative deviation from it */
};

/** The use of a pair. */
enum incise_calibrate_force_state {
	INCISE_CALIBRATE_FORCE_USED,
	INCISE_CALIBRATE_FORCE_SATURATED,
	INCISE_CALIBRATE_FORCE_OUTLIER,
};

/** The result: the line, its range and its uncertainty budget. */
struct incise_calibrate_force {
	double sensitivity_mV_N, sensitivity_u_mV_N; /**< U is twice that (k = 2) */
	double zero_mV, zero_u_mV;
	double covariance;     /**< covariance of both, mV²/N */
	double residual_sd_mV; /**< of used pairs, about the line */
	double scatter_sd_mV;  /**< of readings of one load; basis of type A */
	int freedom;	       /**< degrees of freedom */
	/**
	 * Ratio of the loads' distances from the line to their uncertainty. It increases u if
	 * its probability by chance is below 1 %; otherwise it is 1.
	 */
	double misfit;
	/* In percent of full scale (the largest load used); NAN: not available. */
	double linearity; /**< largest distance of a load's mean from the line */
	/** ascending minus descending; NAN without a descending pair */
	double hysteresis;
	/** spread between ascending series; NAN for fewer than 2 */
	double repeatability;
	double zero_return;   /**< change of zero over a series; NAN: not read */
	double resolution_N;  /**< one code; NAN: unknown */
	double low_N, high_N; /**< smallest and largest load used */
	double clips_N;	      /**< load at the end of the converter; NAN: unknown */
	int pairs, used, saturated, outliers, loads, series;
	bool pass; /**< within tolerance of the nominal sensitivity */
	struct incise_calibration_budget budget; /**< of the sensitivity */
};

/** Set the defaults documented above. */
INCISE_API void incise_calibrate_force_init(struct incise_calibrate_force_setup *setup);

/**
 * Gravity at a place, by Somigliana's formula and its series in height, of WGS 84 (NIMA
 * TR8350.2, equations 4-1 and 4-3). Local rock changes it by up to about 1e-3 m/s²; standard
 * uncertainty 5e-4 m/s².
 *
 * @param latitude_deg -90 … 90
 * @param altitude_m   above the ellipsoid, -1000 … 10000
 * @return m/s²
 */
INCISE_API double incise_calibrate_gravity(double latitude_deg, double altitude_m);

/** The force of a pair in N: m g (1 - air/weight), or force_N. */
INCISE_API double incise_calibrate_force_of(
	const struct incise_calibrate_force_pair *pair,
	const struct incise_calibrate_force_setup *setup);

/**
 * Fit the line. Readings at an end of the converter, or on a plateau of several loads, are
 * omitted, and so are outliers from a least-median-of-squares line (Rousseeuw 1984), up to one
 * pair in ten.
 *
 * @param states use of n pairs, set as far as known even on error; or NULL
 * @return 0 (@result->pass has the verdict); -EINVAL (a value out of range), -ENODATA (fewer
 *         than 5 pairs or 3 different loads), -EDOM (not plausible: swapped columns, other
 *         units, falling readings; more than one outlier in ten; a scatter of more than 2 % of
 *         full scale), -ENOMEM
 */
INCISE_API int incise_calibrate_force(const struct incise_calibrate_force_pair *pairs,
				      int n,
				      const struct incise_calibrate_force_setup *setup,
				      struct incise_calibrate_force *result,
				      enum incise_calibrate_force_state *states,
				      struct incise_error *err);

INCISE_END_DECLS
#endif
