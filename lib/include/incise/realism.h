/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Realism: distances between the texture of rendered cuts and of recorded ones, which nothing was learned from. Part of
 * libincise-learn; incise_train_texture() measures them.
 */
#ifndef INCISE_REALISM_H
#define INCISE_REALISM_H

/** A way to render the texture of cuts. */
enum incise_realism_kind {
	INCISE_REALISM_NONE,	/**< the model alone */
	INCISE_REALISM_NOISE,	/**< normal noise with the spectrum of the texture */
	INCISE_REALISM_TEXTURE, /**< the learned one */
	INCISE_REALISM_KINDS
};

/** Rendered cuts next to the recorded ones, the mean of several seeds. */
struct incise_realism_row {
	double rate; /**< events, relative to the recorded ones */
	double drops; /**< distance of Kolmogorov and Smirnov of the relative drops of events */
	double spectrum_dB; /**< mean distance of four octaves */
	double rms;	    /**< texture's rms, relative to the recorded one */
	double skewness;    /**< of the differences of the force */
	double mean_force;  /**< change of the mean force by the texture, relative */
};

/**
 * Recorded cuts, and the ways to render them. The force is averaged over steps of the way. An event is a
 * fall of at least 6 sd of the sensor's noise and 2 % of the cut's largest force.
 */
struct incise_realism {
	int cuts;	     /**< that were compared */
	double up_to_cycles; /**< per unit of the way: half a cycle each step */
	int events;	     /**< recorded */
	double rate_low,
		rate_high; /**< 95 % interval of Poisson of the rate, relative to the recorded one */
	double skewness; /**< of the differences of the force; a saw-tooth's is negative */
	struct incise_realism_row kind[INCISE_REALISM_KINDS];
};

#endif
