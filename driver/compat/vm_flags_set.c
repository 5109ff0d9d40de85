// SPDX-License-Identifier: GPL-2.0-only
/* 6.3: vm_flags is read-only, and set through functions. */
#include <linux/mm.h>

void probe(struct vm_area_struct *vma);

void probe(struct vm_area_struct *vma)
{
#ifdef NEW
	vm_flags_set(vma, VM_DONTEXPAND);
	vm_flags_clear(vma, VM_MAYWRITE);
#else
	vma->vm_flags |= VM_DONTEXPAND;
#endif
}
