//! The connection to the service manager.

use std::sync::OnceLock;

use relens::daemon::service::ServiceManager;

/// The service manager; messages go nowhere if none started this program.
pub(super) fn service_manager() -> &'static ServiceManager {
    static MANAGER: OnceLock<ServiceManager> = OnceLock::new();
    MANAGER.get_or_init(|| ServiceManager::at(std::env::var_os("NOTIFY_SOCKET").as_deref()))
}
