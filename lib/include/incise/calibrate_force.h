/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Sensitivity of a force channel, from weights and what the channel read: a procedure after
 * ISO 376 (ascending and descending series of loads), not compliance with it. A pure function
 * on arrays; no device and no file. Part of libincise-learn.
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
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

/** A load and what the channel read under it. */
struct incise_calibrate_force_pair {
	double mass_g;	   /**< 0 … 1e6; NAN: force_N is given instead */
	double force_N;	   /**< 0 … 1e4; not looked at where there is a mass */
	double reading_mV; /**< -1e6 … 1e6 */
	int series;	   /**< pairs of one run through the loads have the same number */
	bool descending;   /**< reached by taking weight off */
};

/** Settings beside the pairs; incise_calibrate_force_init() gives the defaults. */
struct incise_calibrate_force_setup {
	double gravity_m_s2,
		gravity_u_m_s2;	       /**< 9.80665, and 0.0173 for anywhere on Earth */
	double air_kg_m3, air_u_kg_m3; /**< 1.2, 0.058: ±0.1, rectangular */
	double weight_kg_m3, weight_u_kg_m3; /**< 7950, 350: steel or brass */
	/** Resolution of the scale that each load was weighed on, g; its rounding is
	 * rectangular, one and the same for all readings of a load, and not there for an
	 * empty pan. 0.5 (paper 1, §2). For loads in N: this times gravity. */
	double scale_g;
	double low_mV, high_mV; /**< ends of the converter; NAN: not known */
	double step_mV;		/**< one code; 0: not known */
	/** Each reading is a mean over noise of half a code or more, so it is finer than a
	 * code. */
	bool dithered;
	double nominal_mV_N; /**< 1240 */
	double tolerance;    /**< 0.05 of it */
};

/** The use of a pair. */
enum incise_calibrate_force_state {
	INCISE_CALIBRATE_FORCE_USED,
	INCISE_CALIBRATE_FORCE_SATURATED,
	INCISE_CALIBRATE_FORCE_OUTLIER,
};

/** A line of the budget of uncertainty. */
struct incise_calibrate_force_part {
	char source[48];
	char type; /**< 'A' by statistics of the readings, 'B' otherwise */
	double u;  /**< standard uncertainty of the source, in @unit */
	char unit[8];
	double sensitivity; /**< mV/N per unit of it */
	double u_mV_N; /**< what it adds to the sensitivity's uncertainty, in squares */
};

/** Lines that a budget has at most. */
#define INCISE_CALIBRATE_FORCE_PARTS 6

/** The result: the line, its range, and the budget of its uncertainty. */
struct incise_calibrate_force {
	double sensitivity_mV_N, sensitivity_u_mV_N; /**< U is twice that (k = 2) */
	double zero_mV, zero_u_mV;
	double covariance;     /**< of both, mV²/N */
	double residual_sd_mV; /**< of the pairs used, about the line */
	double scatter_sd_mV;  /**< of readings of one load; what type A rests on */
	int freedom;	       /**< its degrees of freedom */
	/** Ratio of the loads' distances from the line to those that their uncertainty explains; it
	 * widens u where it is above what chance gives in 1 of 100, else it is 1. */
	double misfit;
	/* In percent of full scale, which is the largest load used; NAN: not stated. */
	double linearity;  /**< largest distance of a load's mean from the line */
	double hysteresis; /**< ascending against descending; no descending pair: NAN */
	double repeatability; /**< spread between ascending series; fewer than 2: NAN */
	double zero_return;   /**< zero after a series against before it; NAN: not read */
	double resolution_N;  /**< one code; NAN: not known */
	double low_N, high_N; /**< smallest and largest load used */
	double clips_N;	      /**< load at which the converter ends; NAN: not known */
	int pairs, used, saturated, outliers, loads, series;
	bool pass; /**< within tolerance of the nominal sensitivity */
	int parts;
	struct incise_calibrate_force_part part[INCISE_CALIBRATE_FORCE_PARTS];
};

/** Defaults as documented above. */
INCISE_API void incise_calibrate_force_init(struct incise_calibrate_force_setup *setup);

/**
 * Gravity at a place, by Somigliana's formula and its series in height, of WGS 84 (NIMA
 * TR8350.2, equations 4-1 and 4-3). Local rock adds up to 1e-3 m/s² or so; standard
 * uncertainty 5e-4 m/s².
 *
 * @param latitude_deg -90 … 90
 * @param altitude_m   above the ellipsoid, -1000 … 10000
 * @return m/s²
 */
INCISE_API double incise_calibrate_gravity(double latitude_deg, double altitude_m);

/** The force of a pair in N: m g (1 - air/weight), or what was given. */
INCISE_API double incise_calibrate_force_of(
	const struct incise_calibrate_force_pair *pair,
	const struct incise_calibrate_force_setup *setup);

/**
 * Fit. Readings at an end of the converter, or on a plateau that several loads share, are
 * left out; outliers from a least-median-of-squares line (Rousseeuw 1984) are left out up to
 * one pair in ten.
 *
 * @param states of n pairs, filled in also where it is refused as far as it is known; or NULL
 * @return 0 (look at @result->pass); -EINVAL (a value out of range), -ENODATA (fewer than 5
 *         pairs or 3 different loads), -EDOM (it cannot be a force channel: columns swapped,
 *         other units, a reading that falls; more than one outlier in ten; a scatter
 *         of more than 2 % of full scale), -ENOMEM
 */
INCISE_API int incise_calibrate_force(const struct incise_calibrate_force_pair *pairs,
				      int n,
				      const struct incise_calibrate_force_setup *setup,
				      struct incise_calibrate_force *result,
				      enum incise_calibrate_force_state *states,
				      struct incise_error *err);

INCISE_END_DECLS
#endif
