/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The caller of a training, who sees its steps and may end it. Long loops count their operations,
 * and the caller is asked once in so many of them: every 10 ms or so, by no clock.
 */
#ifndef INCISE_WATCH_H
#define INCISE_WATCH_H

#include <incise/train.h>

#define WATCH_OPERATIONS 2e7

struct incise_watch {
	incise_train_progress progress; /* or NULL */
	void *user;
	struct incise_train_step step; /* the present one */
	double operations;	       /* since the caller was asked */
	bool stopped; /* every loop ends, and what it returns has no meaning */
};

static inline struct incise_watch incise_watch_of(
	const struct incise_train_options *options)
{
	return (struct incise_watch){options->progress, options->user,
				     .step.phase = INCISE_TRAIN_SEARCH};
}

/* Ask the caller. Returns whether the training ends. */
static inline bool incise_watch_ask(struct incise_watch *watch)
{
	watch->operations = 0;
	if (!watch->stopped && watch->progress)
		watch->stopped = watch->progress(watch->user, &watch->step);
	return watch->stopped;
}

/* Report the end of an epoch. Returns whether the training ends. */
static inline bool incise_watch_epoch(struct incise_watch *watch, int epoch,
				      double train_rmse, double check_rmse)
{
	if (!watch)
		return false;
	watch->step.epoch = epoch;
	watch->step.train_rmse = train_rmse;
	watch->step.check_rmse = check_rmse;
	incise_watch_ask(watch);
	watch->step.epoch = 0;
	return watch->stopped;
}

/* Count operations. Returns whether the training ends; NULL: nobody is asked. */
static inline bool incise_watch_count(struct incise_watch *watch, double operations)
{
	if (!watch)
		return false;
	watch->operations += operations;
	return watch->operations < WATCH_OPERATIONS ? watch->stopped
						    : incise_watch_ask(watch);
}

#endif
