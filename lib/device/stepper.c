// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * An actuator, whatever stands behind it; see incise/stepper.h.
 */
#include "backend.h"

int incise_stepper_set(struct incise_stepper *stepper, double position_mm)
{
	return stepper->ops->set(stepper, position_mm);
}

int incise_stepper_status(struct incise_stepper *stepper,
			  struct incise_stepper_status *status)
{
	return stepper->ops->status(stepper, status);
}

void incise_stepper_info(const struct incise_stepper *stepper,
			 struct incise_stepper_info *info)
{
	stepper->ops->info(stepper, info);
}
