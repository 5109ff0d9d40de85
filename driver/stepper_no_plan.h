/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * Of stepper.h: the functions of plans where the module is built without them (INCISE_PLAN=n).
 * There is never a plan: LOAD_PLAN gives EOPNOTSUPP, and mode POSE is the fault SETPOINT.
 */
#ifndef INCISE_DRIVER_STEPPER_NO_PLAN_H
#define INCISE_DRIVER_STEPPER_NO_PLAN_H

#define STEPPER_PLAN_CAPABILITY 0

static inline int stepper_plan_make(struct stepper *stepper,
				    const struct incise_stepper_plan *load,
				    struct stepper_plan **made)
{
	return -EOPNOTSUPP;
}

static inline void stepper_plan_free(struct stepper_plan *plan)
{
}

static inline int stepper_plan_install(struct stepper *stepper,
				       const struct incise_stepper_plan *load,
				       struct stepper_plan **plan)
{
	return -EOPNOTSUPP;
}

static inline void stepper_plan_take_out(struct stepper *stepper)
{
}

static inline void stepper_plan_new_owner(struct stepper *stepper)
{
}

static inline void stepper_plan_sweep(struct stepper *stepper)
{
}

static inline u32 stepper_plan_let_go(struct stepper *stepper, u32 reason)
{
	return 0;
}

static inline bool stepper_plan_leaving(const struct stepper *stepper)
{
	return false;
}

static inline void stepper_plan_wait(struct stepper *stepper, unsigned int most_ms)
{
}

static inline void stepper_plan_disabled(struct stepper *stepper, u32 motors)
{
}

static inline void stepper_plan_show(struct stepper *stepper, struct seq_file *file)
{
}

static inline void stepper_plan_reset(struct stepper *stepper)
{
}

static inline s64 stepper_plan_due(const struct stepper_motor *motor)
{
	return S64_MAX;
}

static inline void stepper_plan_pose(struct stepper_motor *motor, s64 now, s64 due)
{
	stepper_stop_fault(motor, INCISE_STEPPER_FAULT_SETPOINT, now);
}

static inline void stepper_plan_tick(struct stepper_motor *motor, s64 now)
{
}

static inline bool stepper_plan_reads(const struct stepper_motor *motor)
{
	return false;
}

static inline void stepper_plan_follow(struct stepper_motor *motor, s64 now)
{
}

static inline void stepper_plan_fault(struct stepper_motor *motor, u32 fault)
{
}

static inline void stepper_plan_end(struct stepper_motor *motor, s64 now)
{
}

#endif
