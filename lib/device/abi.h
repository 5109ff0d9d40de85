/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The kernel module's ABI beside the library's own names: two of its structs are called
 * like public ones of incise/stepper.h and are incise_abi_… here. The thread over GPIO
 * uses the same pages and configuration.
 */
#ifndef INCISE_ABI_H
#define INCISE_ABI_H

#define incise_stepper_info incise_abi_info
#define incise_stepper_status incise_abi_status
#include "../../driver/uapi/incise_stepper.h"

/* The numbers of requests hold the structs' sizes: before they get their names back. */
static const unsigned long INCISE_ABI_GET_INFO = INCISE_STEPPER_GET_INFO;

/* What a drive may have beside the kernel's faults; status.faults. */
#define INCISE_ABI_FAULT_BUS (1U << 16)
#define INCISE_ABI_FAULT_LOST (1U << 17)
#define INCISE_ABI_FAULT_FOLLOWING (1U << 18)

#undef incise_stepper_info
#undef incise_stepper_status
#undef INCISE_STEPPER_GET_INFO

#endif
