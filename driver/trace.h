/* SPDX-License-Identifier: GPL-2.0-only */
/*
 * Tracepoints incise_stepper:incise_stepper_edge, for every change of an output that a
 * motor or SYNC makes, incise_stepper:incise_stepper_fault, and
 * incise_stepper:incise_stepper_plan for every tick of a plan. Times in ns of
 * CLOCK_MONOTONIC; an edge's actual is taken after the write, a tick's before it began.
 */
#undef TRACE_SYSTEM
#define TRACE_SYSTEM incise_stepper

#if !defined(INCISE_DRIVER_TRACE_H) || defined(TRACE_HEADER_MULTI_READ)
#define INCISE_DRIVER_TRACE_H

#include <linux/tracepoint.h>

/* No C that clang-format knows. */
/* clang-format off */
TRACE_EVENT(incise_stepper_edge,
	    TP_PROTO(int controller, unsigned int motor, unsigned int line, bool value,
		     s64 due_ns, s64 actual_ns),
	    TP_ARGS(controller, motor, line, value, due_ns, actual_ns),
	    TP_STRUCT__entry(
		    __field(s64, due_ns)
		    __field(s64, actual_ns)
		    __field(int, controller)
		    __field(u8, motor)
		    __field(u8, line)
		    __field(u8, value)
	    ),
	    TP_fast_assign(
		    __entry->due_ns = due_ns;
		    __entry->actual_ns = actual_ns;
		    __entry->controller = controller;
		    __entry->motor = motor;
		    __entry->line = line;
		    __entry->value = value;
	    ),
	    TP_printk("controller=%d motor=%u line=%s value=%u due_ns=%lld actual_ns=%lld",
		      __entry->controller, __entry->motor,
		      __print_symbolic(__entry->line, {5, "enable"}, {6, "dir"}, {7, "step"},
				       {8, "sync"}),
		      __entry->value, __entry->due_ns, __entry->actual_ns)
);

TRACE_EVENT(incise_stepper_fault,
	    TP_PROTO(int controller, unsigned int motor, u32 faults, s64 position, s64 t_ns),
	    TP_ARGS(controller, motor, faults, position, t_ns),
	    TP_STRUCT__entry(
		    __field(s64, position)
		    __field(s64, t_ns)
		    __field(int, controller)
		    __field(u32, faults)
		    __field(u8, motor)
	    ),
	    TP_fast_assign(
		    __entry->position = position;
		    __entry->t_ns = t_ns;
		    __entry->controller = controller;
		    __entry->faults = faults;
		    __entry->motor = motor;
	    ),
	    TP_printk("controller=%d motor=%u faults=%#x position=%lld t_ns=%lld",
		      __entry->controller, __entry->motor, __entry->faults,
		      __entry->position, __entry->t_ns)
);

TRACE_EVENT(incise_stepper_plan,
	    TP_PROTO(int controller, u64 tick, s64 due_ns, s64 actual_ns, u32 cost_ns),
	    TP_ARGS(controller, tick, due_ns, actual_ns, cost_ns),
	    TP_STRUCT__entry(
		    __field(u64, tick)
		    __field(s64, due_ns)
		    __field(s64, actual_ns)
		    __field(int, controller)
		    __field(u32, cost_ns)
	    ),
	    TP_fast_assign(
		    __entry->tick = tick;
		    __entry->due_ns = due_ns;
		    __entry->actual_ns = actual_ns;
		    __entry->controller = controller;
		    __entry->cost_ns = cost_ns;
	    ),
	    TP_printk("controller=%d tick=%llu due_ns=%lld actual_ns=%lld cost_ns=%u",
		      __entry->controller, __entry->tick, __entry->due_ns,
		      __entry->actual_ns, __entry->cost_ns)
);

/* clang-format on */

#endif

#undef TRACE_INCLUDE_PATH
#undef TRACE_INCLUDE_FILE
#define TRACE_INCLUDE_PATH .
#define TRACE_INCLUDE_FILE trace
#include <trace/define_trace.h>
