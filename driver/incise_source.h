/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * A source of poses inside the kernel: a module that measures one position, an encoder say, hands
 * its samples to a plan of incise_stepper.ko, so that no program is in the loop. driver/source is
 * one, for channels of the IIO subsystem.
 *
 *   LOAD_PLAN with INCISE_STEPPER_PLAN_SOURCE ─▶ open(controller, sink)
 *                          samples ─▶ incise_stepper_source_push(sink, raw, t_ns)
 *   the plan goes ─▶ close(source): no push after its return
 *
 * position = origin + direction × scale × raw, with the numbers of LOAD_PLAN.
 */
#ifndef INCISE_DRIVER_INCISE_SOURCE_H
#define INCISE_DRIVER_INCISE_SOURCE_H

#include <linux/types.h>

struct device;
struct incise_stepper_sink;
struct module;

/**
 * struct incise_stepper_source_ops - a module that has sources
 * @owner:	stays loaded while a source is open
 * @open:	begin to push samples of the controller's channel; an ERR_PTR: no such channel.
 *		The first push may come before it returns. May sleep
 * @close:	end it; may sleep. Neither may wait for a file of the controller
 */
struct incise_stepper_source_ops {
	struct module *owner;
	void *(*open)(struct device *controller, struct incise_stepper_sink *sink);
	void (*close)(void *source);
};

/**
 * incise_stepper_source_register() - from now on plans may have a source
 * @ops:	must stay until incise_stepper_source_unregister()
 *
 * Return: 0; -EBUSY: another module has sources.
 */
int incise_stepper_source_register(const struct incise_stepper_source_ops *ops);

/**
 * incise_stepper_source_unregister() - no new source; called from the exit of @ops->owner
 * @ops:	registered before
 */
void incise_stepper_source_unregister(const struct incise_stepper_source_ops *ops);

/**
 * incise_stepper_source_push() - a sample
 * @sink:	what open() was given
 * @raw:	position in the source's own units; any number, held to ±2^30
 * @t_ns:	when it was measured, CLOCK_MONOTONIC; samples that are not newer than the last
 *		are refused and counted
 *
 * From any context, hard interrupts included, one caller at a time per sink. The next tick of
 * the plan takes the newest; older ones of the same tick are left out.
 */
void incise_stepper_source_push(struct incise_stepper_sink *sink, s64 raw, s64 t_ns);

#endif
