"""pyserial and the kernel's CDC-ACM driver against the emulated rig on dummy_hcd."""
